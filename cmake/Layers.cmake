if(UNDERSTORY_TESTS)
  add_custom_target(layer_tests COMMENT "the test programs of the layers")
endif()

# understory_layer(<name> [TOGETHER <number>] SOURCES ... [APART ...] [COLD ...] [TESTS ...] [DEPENDS ...]
#                  [LIBRARIES ...] [PRIVATE_LIBRARIES ...] [TEST_LIBRARIES ...])
# One folder under src/understory is one static library understory_<name> (alias understory::<name>).
#   SOURCES            explicit .cc files; without any the layer is headers only
#   TOGETHER           how many files are compiled as one with UNDERSTORY_UNITY: 8. More save what their
#                      headers cost, but for Eigen's types the compiler's time grows faster than their number.
#                      Layers of text, without such types, take more. A `|` between two files ends a unit:
#                      files behind one form a unit of their own, and only their names must differ in it
#   OPTIMISED          the compiler's option where it is not the usual one. -O1 suits layers in which no time is spent
#   APART              further ones that are compiled by themselves, also with UNDERSTORY_UNITY: names in
#                      them clash with others', or their loops are to be optimised for themselves
#   COLD               further ones in which no time is spent. They are united apart from the others and compiled with
#                      -O1, which takes two thirds of the time
#   TESTS              x_test.cc beside x.cc; together the GoogleTest program test_<name>
#   DEPENDS            layers before it in the order of the top CMakeLists.txt (PUBLIC)
#   LIBRARIES          third-party targets that its headers need (PUBLIC)
#   PRIVATE_LIBRARIES  third-party targets that only its .cc files need
function(understory_layer name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "TOGETHER;OPTIMISED"
                        "SOURCES;APART;COLD;TESTS;DEPENDS;LIBRARIES;PRIVATE_LIBRARIES;TEST_LIBRARIES")
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "understory_layer(${name}): unknown argument ${arg_UNPARSED_ARGUMENTS}")
  endif()
  list(TRANSFORM arg_DEPENDS PREPEND understory::)
  if(NOT arg_TOGETHER)
    set(arg_TOGETHER 8)
  endif()

  set(target understory_${name})
  if(arg_SOURCES)
    add_library(${target} STATIC ${arg_APART})
    understory_unite(${target} ${arg_TOGETHER} ${arg_SOURCES})
    set(scope PUBLIC)
    target_link_libraries(${target} PRIVATE understory_own_code ${arg_PRIVATE_LIBRARIES})
    understory_precompile(${target} ${arg_OPTIMISED})
    if(NOT arg_OPTIMISED)
      set_property(GLOBAL APPEND PROPERTY understory_fast_layers ${target})
    endif()
    if(arg_COLD)
      understory_cold_files(${target} FILES ${arg_COLD}
                            LIBRARIES ${arg_DEPENDS} ${arg_LIBRARIES} ${arg_PRIVATE_LIBRARIES})
    endif()
  else()
    add_library(${target} INTERFACE)
    set(scope INTERFACE)
  endif()
  add_library(understory::${name} ALIAS ${target})
  target_link_libraries(${target} ${scope} understory_flags ${arg_DEPENDS} ${arg_LIBRARIES})
  target_include_directories(${target} ${scope} "${PROJECT_SOURCE_DIR}/src")

  if(arg_TESTS AND UNDERSTORY_TESTS)
    understory_test(test_${name} SOURCES ${arg_TESTS} LAYERS ${name}
                    LIBRARIES ${arg_TEST_LIBRARIES} ${arg_PRIVATE_LIBRARIES} LABELS layer)
    add_dependencies(layer_tests test_${name})
  endif()
endfunction()

# understory_cold_files(<layer> FILES ... LIBRARIES ...): compiles them for the layer's library, with less optimisation.
function(understory_cold_files layer)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "FILES;LIBRARIES")
  add_library(${layer}_cold OBJECT)
  understory_unite(${layer}_cold 16 ${arg_FILES})
  target_link_libraries(${layer}_cold PRIVATE understory_own_code understory_flags ${arg_LIBRARIES})
  target_include_directories(${layer}_cold PRIVATE "${PROJECT_SOURCE_DIR}/src")
  understory_precompile(${layer}_cold -O1)
  target_sources(${layer} PRIVATE "$<TARGET_OBJECTS:${layer}_cold>")
endfunction()

# understory_unite(<target> <together> <source>...): makes the files parts of the target. With
# UNDERSTORY_UNITY so many of them are compiled as one. The headers which they share are parsed
# once, and their templates compiled once: a build from nothing takes half the time. Names in
# unnamed namespaces must differ then: within a layer's sources, and within its tests
# (tools/check_names.py). Files outside src are compiled by themselves. CMake's own unity builds write
# absolute paths, which ccache cannot know again in another clone.
function(understory_unite target together)
  set(batch "")
  set(number 0)
  if(UNDERSTORY_UNITY)
    # A type of an unnamed namespace in an included file is reported, though that file is compiled once.
    target_compile_options(${target} PRIVATE -Wno-subobject-linkage)
  endif()
  foreach(source IN LISTS ARGN)
    if(source STREQUAL "|")
      if(batch)
        understory_write_batch(${target} ${number} "${batch}")
        math(EXPR number "${number} + 1")
        set(batch "")
      endif()
      continue()
    endif()
    file(RELATIVE_PATH path "${PROJECT_SOURCE_DIR}/src" "${CMAKE_CURRENT_SOURCE_DIR}/${source}")
    if(NOT UNDERSTORY_UNITY OR IS_ABSOLUTE "${source}" OR path MATCHES "^\\.\\./")
      target_sources(${target} PRIVATE "${source}")
      continue()
    endif()
    list(APPEND batch "#include \"${path}\"")
    set_source_files_properties("${source}" PROPERTIES HEADER_FILE_ONLY ON)
    target_sources(${target} PRIVATE "${source}")
    list(LENGTH batch length)
    if(length EQUAL together)
      understory_write_batch(${target} ${number} "${batch}")
      math(EXPR number "${number} + 1")
      set(batch "")
    endif()
  endforeach()
  if(batch)
    understory_write_batch(${target} ${number} "${batch}")
  endif()
endfunction()

function(understory_write_batch target number lines)
  list(JOIN lines "\n" text)
  set(file "${CMAKE_CURRENT_BINARY_DIR}/together/${target}_${number}.cc")
  # Unlike WRITE, this leaves a file as it is that holds the same.
  file(CONFIGURE OUTPUT "${file}" CONTENT "${text}\n" @ONLY)
  target_sources(${target} PRIVATE "${file}")
endfunction()

# understory_test(<target> SOURCES ... [LAYERS ...] [LIBRARIES ...] [LABELS ...] [TIMEOUT <seconds>])
# A GoogleTest program whose cases ctest finds one by one. Tests that need the example data look in
# the environment variable UNDERSTORY_DATA, else in ../shared/data beside the source tree, and skip
# when it is absent.
function(understory_test target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "TIMEOUT" "SOURCES;LAYERS;LIBRARIES;LABELS")
  if(NOT UNDERSTORY_TESTS)
    return()
  endif()
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 120)
  endif()
  if(UNDERSTORY_SANITIZERS)
    math(EXPR arg_TIMEOUT "5 * ${arg_TIMEOUT}")
  endif()
  list(TRANSFORM arg_LAYERS PREPEND understory::)
  add_executable(${target})
  understory_unite(${target} 8 ${arg_SOURCES})
  target_link_libraries(${target} PRIVATE understory_own_code ${arg_LAYERS} ${arg_LIBRARIES}
                                          GTest::gtest_main)
  understory_precompile(${target})
  target_compile_definitions(${target} PRIVATE
                             UNDERSTORY_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
                             UNDERSTORY_PROGRAM="${PROJECT_BINARY_DIR}/understory")
  set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/tests")
  gtest_discover_tests(${target} DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60
                       PROPERTIES TIMEOUT ${arg_TIMEOUT} LABELS "${arg_LABELS}")
endfunction()

# understory_python_test(<name> [IN_TURNS] SCRIPT <file> [NEEDS <module>...] [ARGUMENTS ...] [TIMEOUT <seconds>]
#                        [PACKAGES <file>])
# A Python script, run in the environment of tools/python-env.sh; exit status 0 is a pass. It skips
# when a module of NEEDS cannot be imported. The script finds the program in UNDERSTORY_PROGRAM and
# the example data in UNDERSTORY_DATA, and may itself skip with exit status 77. With PACKAGES it runs
# in an environment of its own, of that list of packages (below the top folder). Those with the longest limits start
# first: a long test that starts last would leave processors idle. IN_TURNS: for a test of over 20 s that tries many
# variants; `./run test` runs a third of these with each commit (tools/tests-in-turns.sh).
function(understory_python_test name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "IN_TURNS" "SCRIPT;TIMEOUT;PACKAGES" "NEEDS;ARGUMENTS")
  if(NOT UNDERSTORY_TESTS)
    return()
  endif()
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 300)
  endif()
  list(JOIN arg_NEEDS "," needs)
  add_test(NAME python.${name}
           COMMAND "${PROJECT_SOURCE_DIR}/tools/python-test.sh" "${needs}"
                   "${CMAKE_CURRENT_SOURCE_DIR}/${arg_SCRIPT}" ${arg_ARGUMENTS})
  set_tests_properties(python.${name} PROPERTIES
    SKIP_RETURN_CODE 77 TIMEOUT ${arg_TIMEOUT} COST ${arg_TIMEOUT}
    ENVIRONMENT "UNDERSTORY_PROGRAM=${PROJECT_BINARY_DIR}/understory;UNDERSTORY_BUILD=${PROJECT_BINARY_DIR};UNDERSTORY_PACKAGES=${arg_PACKAGES}")
  if(arg_IN_TURNS)
    set_tests_properties(python.${name} PROPERTIES LABELS in_turns)
  endif()
endfunction()

# understory_program(<target> SOURCES ... [LAYERS ...] [LIBRARIES ...])
# The command-line tool: lies at the root of the build folder and is installed. Its sources are a library that is linked
# behind the layers that are optimised most. Of an inline function the linker takes the first copy that it meets.
function(understory_program target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;LAYERS;LIBRARIES")
  list(TRANSFORM arg_LAYERS PREPEND understory::)
  set(commands ${target}_commands)
  add_library(${commands} STATIC)
  # All of it at once: the parser of options is compiled anew in each part, which takes longer than the rest.
  understory_unite(${commands} 1000 ${arg_SOURCES})
  target_include_directories(${commands} PRIVATE "${PROJECT_SOURCE_DIR}/src")
  target_link_libraries(${commands} PRIVATE understory_own_code understory_flags ${arg_LAYERS} ${arg_LIBRARIES})
  understory_precompile(${commands} -O1)
  target_compile_definitions(${commands} PRIVATE UNDERSTORY_VERSION="${PROJECT_VERSION}")
  add_executable(${target})
  target_link_libraries(${target} PRIVATE understory_own_code understory_flags)
  understory_precompile(${target})
  set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}")
  install(TARGETS ${target} RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}")
endfunction()

# understory_link_program(<target>): when all layers are there.
function(understory_link_program target)
  get_property(fast GLOBAL PROPERTY understory_fast_layers)
  foreach(layer IN LISTS fast)
    target_sources(${target} PRIVATE "$<TARGET_OBJECTS:${layer}>")
  endforeach()
  target_link_libraries(${target} PRIVATE ${target}_commands)
endfunction()

# understory_benchmark(<target> SOURCES ... [LAYERS ...] [LIBRARIES ...])
# A Google Benchmark program in <build>/benchmarks.
function(understory_benchmark target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;LAYERS;LIBRARIES")
  list(TRANSFORM arg_LAYERS PREPEND understory::)
  add_executable(${target} ${arg_SOURCES})
  target_link_libraries(${target} PRIVATE understory_own_code ${arg_LAYERS} ${arg_LIBRARIES}
                                          benchmark::benchmark_main)
  set_target_properties(${target} PROPERTIES
                        RUNTIME_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/benchmarks")
endfunction()

# understory_fuzz(<name> SOURCE <file> [LAYERS ...] [LIBRARIES ...] [ALONE <file under src/understory>...])
# A libFuzzer target fuzz_<name> in <build>/fuzz; tools/fuzz.sh runs all that are there. ALONE: readers of
# a high layer that need none of its others, so that the layers below it need not be built.
function(understory_fuzz name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "SOURCE" "LAYERS;LIBRARIES;ALONE")
  list(TRANSFORM arg_LAYERS PREPEND understory::)
  list(TRANSFORM arg_ALONE PREPEND "${PROJECT_SOURCE_DIR}/src/understory/")
  add_executable(fuzz_${name} ${arg_SOURCE} ${arg_ALONE})
  target_link_libraries(fuzz_${name} PRIVATE understory_own_code ${arg_LAYERS} ${arg_LIBRARIES})
  target_compile_definitions(fuzz_${name} PRIVATE UNDERSTORY_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  target_link_options(fuzz_${name} PRIVATE -fsanitize=fuzzer)
  set_target_properties(fuzz_${name} PROPERTIES
                        RUNTIME_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/fuzz")
  if(NOT TARGET fuzz_targets)
    add_custom_target(fuzz_targets COMMENT "the fuzz targets")
  endif()
  add_dependencies(fuzz_targets fuzz_${name})
endfunction()
