# cmake -DSOURCE= -DFOLDER= -DVERSION= -DMAINTAINER= -P write_package_documents.cmake: changelog.gz (CHANGELOG.md as it is) and
# changelog.Debian.gz, the entries of this version in Debian's form. Its date is that of the last commit, or SOURCE_DATE_EPOCH.
execute_process(COMMAND awk -v version=${VERSION} -f ${SOURCE}/packaging/changelog.awk ${SOURCE}/CHANGELOG.md
                OUTPUT_VARIABLE entries COMMAND_ERROR_IS_FATAL ANY)
if(entries STREQUAL "")
  message(FATAL_ERROR "CHANGELOG.md has no entries of ${VERSION}")
endif()

if(NOT DEFINED ENV{SOURCE_DATE_EPOCH})
  execute_process(COMMAND git log -1 --format=%ct WORKING_DIRECTORY ${SOURCE} OUTPUT_VARIABLE epoch
                  OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  if(NOT epoch MATCHES "^[0-9]+$")
    file(TIMESTAMP ${SOURCE}/CHANGELOG.md epoch "%s" UTC)
  endif()
  set(ENV{SOURCE_DATE_EPOCH} ${epoch})
endif()
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)

file(MAKE_DIRECTORY ${FOLDER})
file(WRITE ${FOLDER}/changelog.Debian
  "crosstie (${VERSION}-1) unstable; urgency=medium\n\n${entries}\n -- ${MAINTAINER}  ${date}\n")
file(COPY_FILE ${SOURCE}/CHANGELOG.md ${FOLDER}/changelog)
execute_process(COMMAND gzip -9nf ${FOLDER}/changelog ${FOLDER}/changelog.Debian COMMAND_ERROR_IS_FATAL ANY)
