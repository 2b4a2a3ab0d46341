# The rules of the build, set once: instruction set, warnings, sanitizers, and the three ways to declare a target.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_CXX_COMPILE_OPTIONS_PIE -fPIC)  # programs are compiled as libraries are, so that both read one precompiled header
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)

if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Release, Debug or RelWithDebInfo" FORCE)
endif()

# One instruction set for every translation unit: Eigen's alignment depends on it.
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  set(DBR_ARCH "x86-64-v3" CACHE STRING "Value of -march for the whole build (native for this machine alone)")
else()
  set(DBR_ARCH "" CACHE STRING "Value of -march for the whole build")
endif()
option(DBR_WERROR "Treat warnings as errors" OFF)
option(DBR_TESTS "Build the tests" ON)
option(DBR_BENCH "Build the benchmark program" ON)
option(DBR_PCH "Read the libraries' large headers once, precompiled (off: each source stands on its own includes)" ON)
set(DBR_SANITIZE "" CACHE STRING "address;undefined or thread")

find_program(CCACHE ccache)
if(CCACHE)
  # Without this ccache does not look at sources that use a precompiled header.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${CCACHE})
endif()

add_library(dbr_flags INTERFACE)
target_include_directories(dbr_flags INTERFACE ${PROJECT_SOURCE_DIR} ${PROJECT_BINARY_DIR})
# Matrices begin at a cache line. Products with AVX-512 or AMX are 3-35% slower where each of their loads crosses into the next.
target_compile_definitions(dbr_flags INTERFACE EIGEN_USE_BLAS EIGEN_MPL2_ONLY EIGEN_MAX_ALIGN_BYTES=64)
if(DBR_ARCH)
  target_compile_options(dbr_flags INTERFACE -march=${DBR_ARCH})
endif()
target_compile_options(dbr_flags INTERFACE -fno-math-errno)
# These macros are the same for all, or no source could read a header that another target precompiled.
target_compile_options(dbr_flags INTERFACE -pthread)
target_compile_definitions(dbr_flags INTERFACE $<TARGET_PROPERTY:spdlog::spdlog,INTERFACE_COMPILE_DEFINITIONS>)
foreach(sanitizer IN LISTS DBR_SANITIZE)
  target_compile_options(dbr_flags INTERFACE -fsanitize=${sanitizer} -fno-omit-frame-pointer)
  target_link_options(dbr_flags INTERFACE -fsanitize=${sanitizer})
endforeach()

add_library(dbr_warnings INTERFACE)
target_compile_options(dbr_warnings INTERFACE -Wall -Wextra -Wno-sign-compare)
if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
  target_compile_options(dbr_warnings INTERFACE -Wthread-safety)
endif()
if(DBR_WERROR)
  target_compile_options(dbr_warnings INTERFACE -Werror)
endif()

# Precompiled headers: the large headers of libraries that many sources include. A source still includes what it uses; builds
# with DBR_PCH off (the thread-safety preset, clang-tidy) find what it forgets.
set(DBR_PCH_PLAIN <algorithm> <array> <atomic> <cmath> <cstdint> <cstring> <functional> <map> <memory> <optional> <string>
  <utility> <vector> <absl/status/status.h> <absl/status/statusor.h> <absl/strings/str_cat.h> <absl/strings/str_join.h>
  <absl/synchronization/mutex.h> <absl/time/time.h> <absl/types/span.h> <Eigen/Core>)
set(DBR_PCH_RPC ${DBR_PCH_PLAIN} <grpcpp/grpcpp.h> <spdlog/spdlog.h>)
set(DBR_PCH_TOOL ${DBR_PCH_RPC} <filesystem> <map> <set> <nlohmann/json.hpp>)
set(DBR_PCH_TEST ${DBR_PCH_PLAIN} <filesystem> <fstream> <map> <set> <sstream> <thread> <gmock/gmock.h> <gtest/gtest.h>
  <nlohmann/json.hpp>)

# dbr_precompile(NAME): makes the precompiled header that targets of the kind NAME (plain, rpc, tool or test) share.
function(dbr_precompile kind)
  cmake_parse_arguments(ARG "" "" "DEPS" ${ARGN})
  string(TOUPPER ${kind} upper)
  file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/pch/${kind}.cc CONTENT "// Only its precompiled header is wanted.\n")
  add_library(dbr_pch_${kind} OBJECT EXCLUDE_FROM_ALL ${PROJECT_BINARY_DIR}/pch/${kind}.cc)
  target_link_libraries(dbr_pch_${kind} PRIVATE dbr_flags dbr_warnings ${ARG_DEPS})
  target_precompile_headers(dbr_pch_${kind} PRIVATE ${DBR_PCH_${upper}})
endfunction()

# Has the target NAME read the precompiled header of a kind ("none": none).
function(dbr_use_precompiled name kind)
  if(DBR_PCH AND NOT kind STREQUAL "none")
    target_precompile_headers(${name} REUSE_FROM dbr_pch_${kind})
  endif()
endfunction()

# dbr_library(NAME SRCS a.cc b.cc DEPS public_libs... PRIVATE_DEPS libs... PCH rpc)
function(dbr_library name)
  cmake_parse_arguments(ARG "" "PCH" "SRCS;DEPS;PRIVATE_DEPS" ${ARGN})
  add_library(${name} STATIC ${ARG_SRCS})
  target_link_libraries(${name} PUBLIC dbr_flags ${ARG_DEPS} PRIVATE dbr_warnings ${ARG_PRIVATE_DEPS})
  if(NOT ARG_PCH)
    set(ARG_PCH plain)
  endif()
  dbr_use_precompiled(${name} ${ARG_PCH})
endfunction()

# dbr_binary(NAME SRCS main.cc DEPS libs...): a program in build/bin.
function(dbr_binary name)
  cmake_parse_arguments(ARG "" "" "SRCS;DEPS" ${ARGN})
  add_executable(${name} ${ARG_SRCS})
  target_link_libraries(${name} PRIVATE dbr_flags dbr_warnings ${ARG_DEPS})
  dbr_use_precompiled(${name} tool)
endfunction()

# dbr_test_on_older_processor(NAME): runs the whole test program NAME once more as on a processor with AVX2 alone, where OpenBLAS
# makes the products and there is no bfloat16.
function(dbr_test_on_older_processor name)
  add_test(NAME ${name}/OnAProcessorWithAvx2Alone COMMAND ${name} --gtest_brief=1)
  set_tests_properties(${name}/OnAProcessorWithAvx2Alone PROPERTIES
    TIMEOUT 300 ENVIRONMENT "OPENBLAS_NUM_THREADS=1;DNNL_MAX_CPU_ISA=AVX2")
endfunction()

# dbr_test(NAME SRCS a_test.cc DEPS libs... LABELS slow TIMEOUT 60 PROGRAMS dbr dbr-actor CORES 2): a GoogleTest program.
# ctest finds its tests in it and runs each by itself, as NAME/Suite.Test: several at once, TIMEOUT seconds at most for each
# (120 unless it is given). PROGRAMS are built before it; a test that starts whole runs takes CORES of those that ctest shares out.
# Reference data: DBR_REFERENCE_DIR in the environment, else tests/reference (compiled in as DBR_DEFAULT_REFERENCE_DIR).
function(dbr_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT;CORES" "SRCS;DEPS;LABELS;PROGRAMS" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  if(NOT ARG_CORES)
    set(ARG_CORES 1)
  endif()
  add_executable(${name} ${ARG_SRCS})
  target_link_libraries(${name} PRIVATE dbr_flags dbr_warnings ${ARG_DEPS} GTest::gmock GTest::gtest GTest::gtest_main)
  target_compile_definitions(${name} PRIVATE
    DBR_DEFAULT_REFERENCE_DIR="${PROJECT_SOURCE_DIR}/tests/reference"
    DBR_BIN_DIR="${CMAKE_RUNTIME_OUTPUT_DIRECTORY}"
    DBR_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  dbr_use_precompiled(${name} test)
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  if(ARG_PROGRAMS)
    add_dependencies(${name} ${ARG_PROGRAMS})
  endif()
  # An empty value would take the name of the next property for it.
  set(labels)
  if(ARG_LABELS)
    set(labels LABELS "${ARG_LABELS}")
  endif()
  gtest_discover_tests(${name} TEST_PREFIX "${name}/" NO_PRETTY_VALUES DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60
    PROPERTIES TIMEOUT ${ARG_TIMEOUT} ${labels} PROCESSORS ${ARG_CORES} ENVIRONMENT OPENBLAS_NUM_THREADS=1)
endfunction()
