# understory::gtsam: the system's GTSAM 4.2 or newer where there is one, else the one that
# tools/deps/build.sh put into the cache. Decides UNDERSTORY_MARCH too, because whatever shares
# Eigen types must be compiled for one instruction set: Eigen's alignment follows from it.
# UNDERSTORY_DEPS may name another folder; the default is asked for anew at each configuration,
# because it changes with the versions and flags.
if(NOT UNDERSTORY_DEPS)
  execute_process(COMMAND "${CMAKE_CURRENT_SOURCE_DIR}/tools/deps/build.sh" --where
                  OUTPUT_VARIABLE understory_deps_default OUTPUT_STRIP_TRAILING_WHITESPACE
                  COMMAND_ERROR_IS_FATAL ANY)
  set(UNDERSTORY_DEPS "${understory_deps_default}")
endif()

# The system's own CMake files of GTSAM name a library that Debian 13 does not ship (libCppUnitLite.a), so
# headers and libraries are looked for here.
find_path(GTSAM_HEADERS NAMES gtsam/nonlinear/ISAM2.h)
find_library(GTSAM_LIBRARY gtsam)
find_library(GTSAM_UNSTABLE_LIBRARY gtsam_unstable)
mark_as_advanced(GTSAM_HEADERS GTSAM_LIBRARY GTSAM_UNSTABLE_LIBRARY)
if(GTSAM_HEADERS AND GTSAM_LIBRARY)
  find_package(Boost 1.67 REQUIRED COMPONENTS serialization timer)
  find_package(TBB REQUIRED)
  add_library(understory_gtsam INTERFACE)
  target_link_libraries(understory_gtsam INTERFACE "${GTSAM_LIBRARY}" Boost::serialization Boost::timer
                                                   TBB::tbb TBB::tbbmalloc)
  if(GTSAM_UNSTABLE_LIBRARY)
    target_link_libraries(understory_gtsam INTERFACE "${GTSAM_UNSTABLE_LIBRARY}")
  endif()
  # The system's GTSAM is built for every processor of the architecture. Own code has to be, too: with AVX Eigen
  # would allocate memory in another way than GTSAM frees it.
  set(understory_march_default "")
else()
  execute_process(COMMAND "${CMAKE_CURRENT_SOURCE_DIR}/tools/deps/build.sh" --march
                  OUTPUT_VARIABLE understory_march_default OUTPUT_STRIP_TRAILING_WHITESPACE
                  COMMAND_ERROR_IS_FATAL ANY)
  add_library(understory_gtsam INTERFACE)
  if(EXISTS "${UNDERSTORY_DEPS}/lib/cmake/gtsam/gtsam-targets.cmake")
    find_package(Boost 1.67 REQUIRED COMPONENTS serialization timer)
    find_package(Eigen3 3.4 REQUIRED NO_MODULE)
    include("${UNDERSTORY_DEPS}/lib/cmake/gtsam/gtsam-targets.cmake")
    target_link_libraries(understory_gtsam INTERFACE understory_deps::gtsam)
    file(READ "${UNDERSTORY_DEPS}/march" understory_gtsam_march)
    string(STRIP "${understory_gtsam_march}" understory_gtsam_march)
  else()
    message(WARNING "no GTSAM in the system or in ${UNDERSTORY_DEPS}: graph and odometry will not "
                    "build. Run ./run setup, which builds it once.")
  endif()
endif()
add_library(understory::gtsam ALIAS understory_gtsam)

set(UNDERSTORY_MARCH "${understory_march_default}" CACHE STRING
    "instruction set of the whole program (-march=), the same as GTSAM's")
if(DEFINED understory_gtsam_march AND NOT UNDERSTORY_MARCH STREQUAL understory_gtsam_march)
  message(FATAL_ERROR "UNDERSTORY_MARCH is '${UNDERSTORY_MARCH}', but GTSAM in the cache was built "
                      "for '${understory_gtsam_march}'. Set the environment variable "
                      "UNDERSTORY_MARCH and run ./run setup, or leave it to the default.")
endif()
if(UNDERSTORY_MARCH)
  target_compile_options(understory_flags INTERFACE -march=${UNDERSTORY_MARCH})
endif()
