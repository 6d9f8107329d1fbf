# Flags in two targets: understory_flags for everything that shares types (standard, instruction
# set, sanitizers), understory_own_code for our own files only (warnings).
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
endif()

if(NOT CMAKE_CXX_COMPILER_LAUNCHER)
  find_program(CCACHE_PROGRAM ccache)
  mark_as_advanced(CCACHE_PROGRAM)
  if(CCACHE_PROGRAM)
    set(CMAKE_C_COMPILER_LAUNCHER "${CCACHE_PROGRAM}")
    # What ccache wants to know where headers are precompiled.
    set(CMAKE_CXX_COMPILER_LAUNCHER "${CMAKE_COMMAND}" -E env
        "CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime"
        "CCACHE_IGNOREOPTIONS=--param=ggc-*"
        "${CCACHE_PROGRAM}")
  endif()
endif()

add_library(understory_flags INTERFACE)
add_library(understory_own_code INTERFACE)
target_compile_options(understory_own_code INTERFACE
  -Wall -Wextra -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual
  $<$<BOOL:${UNDERSTORY_WARNINGS_AS_ERRORS}>:-Werror>
  # GCC's flow warnings come after inlining and report accesses inside Eigen's vector code and
  # std::string that cannot be (GCC bugs 105651, 106247). The sanitizers look for the real ones.
  "$<$<CXX_COMPILER_ID:GNU>:-Wno-restrict;-Wno-array-bounds;-Wno-stringop-overflow>"
  "$<$<CXX_COMPILER_ID:GNU>:-Wno-stringop-overread;-Wno-maybe-uninitialized>")
# GCC looks for garbage each time its heap has doubled, from some 100 MB on. Beginning at 700 MB saves up to a
# seventh of the time of a file that Eigen or CLI11 fill. The largest file needs 1.7 GB then, and needed 1.5 GB.
target_compile_options(understory_own_code INTERFACE
  "$<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=700000>")
find_package(Threads REQUIRED)
target_link_libraries(understory_flags INTERFACE Threads::Threads)

if(UNDERSTORY_SANITIZERS)
  target_compile_options(understory_flags INTERFACE
    -fsanitize=${UNDERSTORY_SANITIZERS} -fno-omit-frame-pointer)
  target_link_options(understory_flags INTERFACE -fsanitize=${UNDERSTORY_SANITIZERS})
  target_compile_definitions(understory_flags INTERFACE UNDERSTORY_SANITIZED)
  if(UNDERSTORY_SANITIZERS MATCHES "undefined")
    target_compile_options(understory_flags INTERFACE -fno-sanitize-recover=undefined)
  endif()
endif()

# Linking with lld takes a tenth of the time of the default linker.
find_program(LLD_PROGRAM ld.lld)
mark_as_advanced(LLD_PROGRAM)
if(LLD_PROGRAM)
  add_link_options(-fuse-ld=lld)
endif()
