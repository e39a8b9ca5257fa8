# Proves that dist/viewer.js is what its sources make: builds it again and compares byte by byte.
#   cmake -DSOURCE=report/viewer -DWORK=build/viewer -P check_dist.cmake
# Where there is no npm, or no package registry within reach, it says "skipped".
find_program(NPM npm)
find_program(NODE node)
if(NOT NPM OR NOT NODE)
  message("skipped: no Node.js here")
  return()
endif()
file(MAKE_DIRECTORY ${WORK}/dist)
file(COPY ${SOURCE}/package.json ${SOURCE}/package-lock.json ${SOURCE}/.npmrc ${SOURCE}/build.mjs ${SOURCE}/tsconfig.json ${SOURCE}/src
     DESTINATION ${WORK})
execute_process(COMMAND ${NPM} ci --no-audit --no-fund WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed OUTPUT_QUIET ERROR_QUIET TIMEOUT 240)
if(failed)
  message("skipped: npm ci did not get the packages")
  return()
endif()
execute_process(COMMAND ${NODE} build.mjs dist/viewer.js WORKING_DIRECTORY ${WORK} COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${CMAKE_COMMAND} -E compare_files ${WORK}/dist/viewer.js ${SOURCE}/dist/viewer.js RESULT_VARIABLE differs)
if(differs)
  message(FATAL_ERROR "report/viewer/dist/viewer.js is not what its sources make: run npm ci && npm run build in report/viewer and commit it")
endif()
message("dist/viewer.js is what its sources make")
