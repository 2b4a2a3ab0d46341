# Writes OUT, a header with the commit of the checkout in SOURCE_DIR, unless it says so already. Run by every build (deploy/CMakeLists.txt).
set(commit "unknown")
execute_process(COMMAND git -C ${SOURCE_DIR} rev-parse HEAD OUTPUT_VARIABLE head RESULT_VARIABLE failed ERROR_QUIET
                OUTPUT_STRIP_TRAILING_WHITESPACE)
if("${failed}" STREQUAL "0")
  set(commit ${head})
  execute_process(COMMAND git --no-optional-locks -C ${SOURCE_DIR} status --porcelain --untracked-files=no OUTPUT_VARIABLE changes
                  ERROR_QUIET)
  if(changes)
    string(APPEND commit "+changes")
  endif()
endif()
file(CONFIGURE OUTPUT ${OUT} CONTENT "#define DBR_BUILD_COMMIT \"${commit}\"\n")
