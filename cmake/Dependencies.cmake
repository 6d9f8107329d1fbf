# Every third-party library as an imported target, so that its headers count as system headers.
#   Eigen3::Eigen TBB::tbb fmt::fmt understory::nanoflann understory::gdal understory::embree
#   understory::lz4 understory::zstd understory::bz2 ZLIB::ZLIB SQLite::SQLite3 yaml-cpp
#   CLI11::CLI11 nlohmann_json::nlohmann_json GTest::gtest_main understory::gtsam understory::laszip
include(Gtsam)
include(Laszip)

# understory_find(<name> HEADER <file> [LIBRARY <name>] [SUFFIXES <include subfolder>])
# For packages without a usable CMake file of their own.
function(understory_find name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "HEADER;LIBRARY" "SUFFIXES")
  string(TOUPPER ${name} upper)
  find_path(${upper}_HEADERS NAMES ${arg_HEADER} PATH_SUFFIXES ${arg_SUFFIXES} REQUIRED)
  mark_as_advanced(${upper}_HEADERS)
  add_library(understory_dep_${name} INTERFACE IMPORTED GLOBAL)
  add_library(understory::${name} ALIAS understory_dep_${name})
  if(NOT ${upper}_HEADERS STREQUAL "/usr/include")
    target_include_directories(understory_dep_${name} SYSTEM INTERFACE "${${upper}_HEADERS}")
  endif()
  if(arg_LIBRARY)
    find_library(${upper}_LIBRARY ${arg_LIBRARY} REQUIRED)
    mark_as_advanced(${upper}_LIBRARY)
    target_link_libraries(understory_dep_${name} INTERFACE "${${upper}_LIBRARY}")
  endif()
endfunction()

# understory_dependency(<name> <target>...): gives package targets our own name.
function(understory_dependency name)
  add_library(understory_dep_${name} INTERFACE IMPORTED GLOBAL)
  add_library(understory::${name} ALIAS understory_dep_${name})
  target_link_libraries(understory_dep_${name} INTERFACE ${ARGN})
endfunction()

find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(TBB REQUIRED)
find_package(fmt REQUIRED)
find_package(ZLIB REQUIRED)
find_package(BZip2 REQUIRED)
find_package(SQLite3 REQUIRED)
find_package(yaml-cpp REQUIRED)
find_package(CLI11 REQUIRED)
find_package(nlohmann_json REQUIRED)
understory_dependency(bz2 BZip2::BZip2)
# yaml-cpp 0.8 renamed its target.
if(NOT TARGET yaml-cpp)
  add_library(yaml-cpp INTERFACE IMPORTED GLOBAL)
  target_link_libraries(yaml-cpp INTERFACE yaml-cpp::yaml-cpp)
endif()
understory_find(nanoflann HEADER nanoflann.hpp)
understory_find(lz4 HEADER lz4frame.h LIBRARY lz4)
understory_find(zstd HEADER zstd.h LIBRARY zstd)
understory_find(gdal HEADER gdal_priv.h LIBRARY gdal SUFFIXES gdal)

# Embree 4 (Debian 13) and 3 (Debian 12) differ in the header's folder and a few calls.
find_path(EMBREE_HEADERS NAMES embree4/rtcore.h embree3/rtcore.h REQUIRED)
if(EXISTS "${EMBREE_HEADERS}/embree4/rtcore.h")
  understory_find(embree HEADER embree4/rtcore.h LIBRARY embree4)
  target_compile_definitions(understory_dep_embree INTERFACE UNDERSTORY_EMBREE_VERSION=4)
else()
  understory_find(embree HEADER embree3/rtcore.h LIBRARY embree3)
  target_compile_definitions(understory_dep_embree INTERFACE UNDERSTORY_EMBREE_VERSION=3)
endif()

if(UNDERSTORY_TESTS)
  find_package(GTest REQUIRED)
endif()
if(UNDERSTORY_BENCHMARKS)
  find_package(benchmark REQUIRED)
endif()
