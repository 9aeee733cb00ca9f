# Installs BUILD anew into PREFIX and fails where its include folder is not HEADERS, file by file.
file(REMOVE_RECURSE ${PREFIX})
execute_process(COMMAND ${CMAKE_COMMAND} --install ${BUILD} --prefix ${PREFIX}
                OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
file(GLOB_RECURSE expected RELATIVE ${HEADERS} ${HEADERS}/*)
file(GLOB_RECURSE found RELATIVE ${PREFIX}/include ${PREFIX}/include/*)
set(missing ${expected})
set(beyond ${found})
list(REMOVE_ITEM missing ${found})
list(REMOVE_ITEM beyond ${expected})
file(GLOB_RECURSE libraries ${PREFIX}/*.a ${PREFIX}/*.lib)
if(missing OR beyond OR libraries OR NOT expected)
  message(FATAL_ERROR "not installed: '${missing}'; installed beyond ${HEADERS}: '${beyond}'; "
                      "libraries: '${libraries}'")
endif()
