// Where the files are that the program reads beside its own: the catalogue, the plot scripts, the configurations.
#pragma once

#include <filesystem>

namespace arboretum {

/// The folder that holds scenes/catalogue.yaml, plots/ and configs/. In this order: $ARBORETUM_DATA; share/arboretum
/// beside the executable, or one folder up (a build tree, where it links to the sources); where `cmake --install` puts
/// it, seen from the executable, so that an installed tree may be moved. Throws UserError when there is none, or when
/// $ARBORETUM_DATA names none.
[[nodiscard]] std::filesystem::path data_folder();
/// The same, $ARBORETUM_DATA left aside: what was built or installed together with the executable. Empty when there is
/// none.
[[nodiscard]] std::filesystem::path program_data_folder();

}  // namespace arboretum
