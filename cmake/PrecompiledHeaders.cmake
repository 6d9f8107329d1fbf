# The headers of the standard library and of Eigen that most files include are parsed once and not
# 250 times. That is half of the time of a build. Every file still includes what it uses, so it
# compiles without this, too (UNDERSTORY_PRECOMPILE=OFF). Clang's presets do without: clang-tidy
# would read the files in another way than the compiler.
set(understory_shared_headers
  <algorithm> <array> <cmath> <cstdint> <cstring> <filesystem> <functional> <limits> <map> <memory>
  <numeric> <optional> <span> <string> <string_view> <variant> <vector> <Eigen/Core> <Eigen/Geometry>)

# understory_precompile(<target> [<options>]): the target's files are compiled with the shared headers. GCC takes
# the level of optimisation from these, so a target with another one has headers of its own level.
function(understory_precompile target)
  set(level "${ARGN}")
  target_compile_options(${target} PRIVATE ${level})
  if(NOT UNDERSTORY_PRECOMPILE OR NOT CMAKE_CXX_COMPILER_ID STREQUAL "GNU" OR UNDERSTORY_SANITIZERS)
    return()
  endif()
  set(headers "understory_precompiled${level}")
  if(NOT TARGET ${headers})
    # Unlike WRITE, this leaves a file as it is that holds the same: else every configuration would
    # make all files be compiled again.
    set(file "${PROJECT_BINARY_DIR}/precompiled/${headers}.cc")
    file(CONFIGURE OUTPUT "${file}" CONTENT "// The headers alone.\n" @ONLY)
    add_library(${headers} OBJECT "${file}")
    target_link_libraries(${headers} PRIVATE understory_own_code understory_flags Eigen3::Eigen)
    target_precompile_headers(${headers} PRIVATE ${understory_shared_headers})
    target_compile_options(${headers} PRIVATE -fpch-preprocess ${level})
  endif()
  target_compile_options(${target} PRIVATE -fpch-preprocess)
  # CMake compiles programs with -fPIE, and the compiler takes headers of its own settings only.
  get_target_property(type ${target} TYPE)
  if(type STREQUAL "EXECUTABLE")
    target_compile_options(${target} PRIVATE -fPIC)
  endif()
  target_precompile_headers(${target} REUSE_FROM ${headers})
endfunction()
