# `cmake --install build --prefix P`: the programs in bin, what a user names as deploy/... in share/dbr (where FindShippedFile
# looks for it), and the manual pages and completion scripts that the programs write about themselves.
include(GNUInstallDirs)

install(TARGETS dbr dbr-replay dbr-learner dbr-actor RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(DIRECTORY deploy/configs deploy/experiments deploy/policies DESTINATION share/dbr)
install(FILES README.md CHANGELOG.md CONTRIBUTING.md CITATION.cff LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR})

# Written in place while dbr is installed, and not by each build: the four programs are all that must have been built, and two
# installations at once do not meet in the build folder.
install(CODE "
  set(bin \"${CMAKE_RUNTIME_OUTPUT_DIRECTORY}\")
  set(prefix \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}\")
  set(man \"\${prefix}/${CMAKE_INSTALL_MANDIR}/man1\")
  message(STATUS \"Writing manual pages: \${man}\")
  foreach(program dbr dbr-replay dbr-learner dbr-actor)
    execute_process(COMMAND \"\${bin}/\${program}\" --man-pages \"\${man}\" COMMAND_ERROR_IS_FATAL ANY)
  endforeach()
  foreach(script bash-completion/completions/dbr zsh/site-functions/_dbr fish/vendor_completions.d/dbr.fish)
    string(REGEX MATCH \"^[a-z]+\" shell \"\${script}\")
    get_filename_component(folder \"\${prefix}/share/\${script}\" DIRECTORY)
    message(STATUS \"Writing completion: \${prefix}/share/\${script}\")
    file(MAKE_DIRECTORY \"\${folder}\")
    execute_process(COMMAND \"\${bin}/dbr\" completion \${shell} OUTPUT_FILE \"\${prefix}/share/\${script}\"
                    COMMAND_ERROR_IS_FATAL ANY)
  endforeach()
  file(GLOB pages \"\${man}/dbr*.1\")
  list(APPEND CMAKE_INSTALL_MANIFEST_FILES \${pages})
")
