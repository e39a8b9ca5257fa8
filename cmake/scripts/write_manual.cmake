# cmake -DCROSSTIE=<executable> -DFOLDER=<folder> -P write_manual.cmake: man pages (FOLDER/man1/*.1.gz) and bash completion
# (FOLDER/completions/crosstie), which the executable prints.
function(print_into file)
  execute_process(COMMAND ${CROSSTIE} help ${ARGN} OUTPUT_FILE ${file} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

file(REMOVE_RECURSE ${FOLDER}/man1 ${FOLDER}/completions)
file(MAKE_DIRECTORY ${FOLDER}/man1 ${FOLDER}/completions)
print_into(${FOLDER}/completions/crosstie --bash-completion)
print_into(${FOLDER}/man1/crosstie.1 --man)
execute_process(COMMAND ${CROSSTIE} help --verbs OUTPUT_VARIABLE verbs OUTPUT_STRIP_TRAILING_WHITESPACE
                COMMAND_ERROR_IS_FATAL ANY)
string(REPLACE "\n" ";" verbs "${verbs}")
foreach(verb IN LISTS verbs)
  print_into(${FOLDER}/man1/crosstie-${verb}.1 --man ${verb})
endforeach()
file(GLOB pages ${FOLDER}/man1/*.1)
execute_process(COMMAND gzip -9n ${pages} COMMAND_ERROR_IS_FATAL ANY)
