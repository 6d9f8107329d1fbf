# The headers of the standard library and of Eigen that most files include are parsed once and not
# 250 times. That is half of the time of a build. Every file still includes what it uses, so it
# compiles without this, too (UNDERSTORY_PRECOMPILE=OFF). Clang's presets do without: clang-tidy
# would read the files in another way than the compiler.
set(understory_shared_headers
  <algorithm> <array> <cmath> <cstdint> <cstring> <filesystem> <functional> <limits> <map> <memory>
  <numeric> <optional> <span> <string> <string_view> <variant> <vector> <Eigen/Core> <Eigen/Geometry>)

# understory_precompile(<target>): the target's files are compiled with the shared headers.
function(understory_precompile target)
  if(NOT UNDERSTORY_PRECOMPILE OR NOT CMAKE_CXX_COMPILER_ID STREQUAL "GNU" OR UNDERSTORY_SANITIZERS)
    return()
  endif()
  if(NOT TARGET understory_precompiled)
    # Unlike WRITE, this leaves a file as it is that holds the same: else every configuration would
    # make all files be compiled again.
    file(CONFIGURE OUTPUT "${PROJECT_BINARY_DIR}/precompiled/precompiled.cc"
         CONTENT "// The headers alone.\n" @ONLY)
    add_library(understory_precompiled OBJECT "${PROJECT_BINARY_DIR}/precompiled/precompiled.cc")
    target_link_libraries(understory_precompiled PRIVATE understory_own_code understory_flags Eigen3::Eigen)
    target_precompile_headers(understory_precompiled PRIVATE ${understory_shared_headers})
    target_compile_options(understory_precompiled PRIVATE -fpch-preprocess)
  endif()
  target_compile_options(${target} PRIVATE -fpch-preprocess)
  # CMake compiles programs with -fPIE, and the compiler takes headers of its own settings only.
  get_target_property(type ${target} TYPE)
  if(type STREQUAL "EXECUTABLE")
    target_compile_options(${target} PRIVATE -fPIC)
  endif()
  target_precompile_headers(${target} REUSE_FROM understory_precompiled)
endfunction()
