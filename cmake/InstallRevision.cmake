# Run by `cmake --install`: writes the git revision of ${source}, and `dirty` where files differ from it, to ${destination}/revision.
cmake_policy(VERSION 3.22)
set(hash unknown)
set(state "")
find_program(GIT_PROGRAM git)
if(GIT_PROGRAM)
  execute_process(COMMAND ${GIT_PROGRAM} -c safe.directory=* -C "${source}" rev-parse HEAD
                  OUTPUT_VARIABLE found OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE status ERROR_QUIET)
  if(status EQUAL 0)
    set(hash ${found})
    execute_process(COMMAND ${GIT_PROGRAM} -c safe.directory=* -C "${source}" status --porcelain --untracked-files=no
                    OUTPUT_VARIABLE changes OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
    if(NOT changes STREQUAL "")
      set(state " dirty")
    endif()
  endif()
endif()
file(WRITE "${stage}/revision" "${hash}${state}\n")
file(INSTALL DESTINATION "${destination}" TYPE FILE FILES "${stage}/revision")
