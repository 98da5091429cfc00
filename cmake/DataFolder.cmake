# share/arboretum of the build tree: links to the sources, laid out as `cmake --install` lays out the files themselves, so
# that core/data_folder.h finds both alike. Sets ARBORETUM_DATA_FROM_BINARY, the way from an installed executable.
include(GNUInstallDirs)
file(RELATIVE_PATH ARBORETUM_DATA_FROM_BINARY "${CMAKE_INSTALL_FULL_BINDIR}" "${CMAKE_INSTALL_FULL_DATADIR}/arboretum")
set(ARBORETUM_DATA_FOLDERS scenes plots configs tests)
file(MAKE_DIRECTORY ${PROJECT_BINARY_DIR}/share/arboretum)
foreach(folder IN LISTS ARBORETUM_DATA_FOLDERS)
  file(CREATE_LINK ${PROJECT_SOURCE_DIR}/${folder} ${PROJECT_BINARY_DIR}/share/arboretum/${folder} SYMBOLIC)
endforeach()
file(CREATE_LINK ${PROJECT_SOURCE_DIR} ${PROJECT_BINARY_DIR}/share/arboretum/source SYMBOLIC)  # for the git revision
