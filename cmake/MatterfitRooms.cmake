# SPDX-License-Identifier: GPL-3.0-or-later
# matterfit_room(NAME LINK a b …): native/NAME is a library matterfit_NAME of all *.cpp in it and in
# the folders below it; *_test.cpp become test_NAME, *_fuzz.cpp one libFuzzer program each.
# PART p SOURCES stems … USES libraries …: these files of the room, with the tests beside them, form
# a library matterfit_NAME_p (and test_NAME_p) of their own that the room links and its fuzzers
# link alone, so that a parser is fuzzed without building the solver.

add_library(matterfit_flags INTERFACE)
target_compile_options(matterfit_flags INTERFACE -Wall -Wextra -Wpedantic -Wconversion
  -Wno-sign-conversion -march=x86-64-v2 -maes -mpclmul -ffp-contract=fast -fno-math-errno)
# GCC collects its garbage from some 100 MB on, which is a sixth of the time of a compilation that
# needs 500 to 900: it begins at 1 GB instead, which few reach.
target_compile_options(matterfit_flags INTERFACE
  $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=1000000>)
if(MATTERFIT_WERROR)
  # GCC 12 sees an overlap in std::string + literal that is not there (its bug 105651).
  target_compile_options(matterfit_flags INTERFACE -Werror $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)
endif()
if(MATTERFIT_SANITIZE)
  if(CMAKE_CXX_COMPILER_ID MATCHES Clang)
    target_compile_options(matterfit_flags INTERFACE
      -fsanitize-ignorelist=${CMAKE_SOURCE_DIR}/cmake/sanitize_ignore.txt)
  endif()
  target_compile_options(matterfit_flags INTERFACE -fsanitize=address,undefined
    -fno-sanitize-recover=undefined -fno-omit-frame-pointer -g1
    # clang's `vptr` and `function` compare type infos that a hidden-visibility library does not share.
    # `pointer-overflow` (arithmetic that wraps around the address space) is half of the time of a
    # compilation, more in the kernels; AddressSanitizer sees where such a pointer is used.
    $<$<CXX_COMPILER_ID:Clang>:-fno-sanitize=vptr,function,pointer-overflow>)
  target_link_options(matterfit_flags INTERFACE -fsanitize=address,undefined)
endif()
if(MATTERFIT_FUZZ)
  target_compile_options(matterfit_flags INTERFACE -fsanitize=address -g1)
  target_link_options(matterfit_flags INTERFACE -fsanitize=address)
  # What libFuzzer sees of the paths through a parser; elsewhere it is a fifth of the time of a build.
  # (-fsanitize=fuzzer-no-link would keep these rooms from the precompiled headers of the others.)
  set(MATTERFIT_COVERAGE -fsanitize-coverage=inline-8bit-counters,indirect-calls,trace-cmp,pc-table)
endif()
# Instrumented kernels take minutes to compile for each target; one is enough to find a wild access.
if(MATTERFIT_SANITIZE OR MATTERFIT_FUZZ)
  set(MATTERFIT_FEWER_TARGETS "|HWY_AVX3|HWY_AVX2")
endif()
# Exactly the three targets that we test: SSE4, AVX2, AVX-512.
target_compile_definitions(matterfit_flags INTERFACE
  HWY_DISABLED_TARGETS=\(HWY_AVX3_DL|HWY_SSSE3${MATTERFIT_FEWER_TARGETS}\)
  MATTERFIT_VERSION=\"${PROJECT_VERSION}\")
if(CMAKE_UNITY_BUILD)
  # GCC takes what a file's unnamed namespace holds for another file's once one includes the other.
  target_compile_options(matterfit_flags INTERFACE
    $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
endif()
# What a test itself computes is little: the time goes into compiling it. GCC at -O1 sees less of what
# is set where.
set(MATTERFIT_TEST_OPTIONS -O1 $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
if(MATTERFIT_SANITIZE)
  set(MATTERFIT_TEST_OPTIONS -O0)
endif()

# Headers that nearly every file reads, parsed once for all rooms and once for all tests: half of the
# time of a build from nothing went there. What a file needs it includes all the same.
function(matterfit_precompiled_headers)
  # Written only where they differ, so that nothing is compiled again.
  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/precompiled/rooms.cpp CONTENT "")
  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/precompiled/tests.cpp CONTENT "int main() {}\n")
  set(headers <algorithm> <array> <cmath> <cstdint> <filesystem> <functional> <limits> <map> <memory>
    <numeric> <optional> <random> <span> <sstream> <string> <string_view> <utility> <vector>
    <Eigen/Dense>)
  add_library(matterfit_precompiled STATIC ${CMAKE_BINARY_DIR}/precompiled/rooms.cpp)
  target_link_libraries(matterfit_precompiled PRIVATE matterfit_flags)
  matterfit_link(matterfit_precompiled PRIVATE Eigen3::Eigen)
  target_precompile_headers(matterfit_precompiled PRIVATE ${headers})
  if(MATTERFIT_TESTS)
    # A program: those are compiled as -fPIE, rooms as -fPIC, which precompiled headers mind.
    add_executable(matterfit_tests_precompiled ${CMAKE_BINARY_DIR}/precompiled/tests.cpp)
    target_link_libraries(matterfit_tests_precompiled PRIVATE matterfit_flags GTest::gtest GTest::gmock)
    matterfit_link(matterfit_tests_precompiled PRIVATE Eigen3::Eigen)
    target_compile_options(matterfit_tests_precompiled PRIVATE ${MATTERFIT_TEST_OPTIONS})
    target_precompile_headers(matterfit_tests_precompiled PRIVATE ${headers} <gtest/gtest.h>
      <gmock/gmock.h>)
  endif()
endfunction()

# Links rooms by name and other libraries with their headers as system headers.
function(matterfit_link target scope)
  foreach(dependency IN LISTS ARGN)
    if(TARGET matterfit_${dependency})
      target_link_libraries(${target} ${scope} matterfit_${dependency})
    else()
      get_target_property(system_includes ${dependency} INTERFACE_INCLUDE_DIRECTORIES)
      if(system_includes)
        target_include_directories(${target} SYSTEM ${scope} ${system_includes})
      endif()
      target_link_libraries(${target} ${scope} ${dependency})
    endif()
  endforeach()
endfunction()

# test_NAME from these files, against matterfit_NAME.
function(matterfit_test name)
  if(NOT ARGN OR NOT MATTERFIT_TESTS)
    return()
  endif()
  add_executable(test_${name} ${ARGN})
  target_link_libraries(test_${name} PRIVATE matterfit_${name} GTest::gtest GTest::gmock GTest::gtest_main)
  target_compile_options(test_${name} PRIVATE ${MATTERFIT_TEST_OPTIONS})
  target_precompile_headers(test_${name} REUSE_FROM matterfit_tests_precompiled)
  target_compile_definitions(test_${name} PRIVATE
    MATTERFIT_SOURCE_DIR=\"${CMAKE_SOURCE_DIR}\" MATTERFIT_DATA_DIR=\"${CMAKE_SOURCE_DIR}/../shared/data\")
  add_test(NAME ${name} COMMAND test_${name})
endfunction()

# matterfit_floors(a b/c …): the folders of native/, lowest first. A file belongs to the last floor
# named here that its path begins with; configuring fails where it belongs to none, where it includes a
# header of a floor above, and where it includes one by a path that does not begin at native/.
function(matterfit_floors)
  set(floors ${ARGN})
  set(native ${CMAKE_SOURCE_DIR}/native)
  file(GLOB_RECURSE files CONFIGURE_DEPENDS ${native}/*.[ch]pp ${native}/*.[ch])
  foreach(file IN LISTS files)
    file(RELATIVE_PATH shown ${CMAKE_SOURCE_DIR} ${file})
    matterfit_floor_of(${file} "${floors}" own)
    if(own EQUAL -1)
      message(SEND_ERROR "${shown} lies on no floor (matterfit_floors in CMakeLists.txt).")
      continue()
    endif()
    cmake_path(GET file PARENT_PATH folder)
    file(STRINGS ${file} includes REGEX "^[ \t]*#[ \t]*include[ \t]*[\"<]")
    foreach(line IN LISTS includes)
      string(REGEX REPLACE "^[^\"<]*[\"<]([^\">]+).*" "\\1" header "${line}")
      if(NOT EXISTS ${native}/${header})
        if(EXISTS ${folder}/${header})
          message(SEND_ERROR "${shown} includes ${header}: its path is to begin at native/.")
        endif()
        continue()
      endif()
      matterfit_floor_of(${native}/${header} "${floors}" other)
      if(other GREATER own)
        list(GET floors ${own} lower)
        list(GET floors ${other} upper)
        message(SEND_ERROR "${shown} includes ${header}: ${upper}/ lies above ${lower}/ "
          "(matterfit_floors in CMakeLists.txt).")
      endif()
    endforeach()
  endforeach()
endfunction()

# The index in `floors` of the floor a file belongs to.
function(matterfit_floor_of file floors result)
  file(RELATIVE_PATH path ${CMAKE_SOURCE_DIR}/native ${file})
  set(best -1)
  set(length 0)
  set(at 0)
  foreach(floor IN LISTS floors)
    string(LENGTH ${floor} own)
    string(FIND ${path} ${floor}/ begin)
    if(begin EQUAL 0 AND own GREATER length)
      set(best ${at})
      set(length ${own})
    endif()
    math(EXPR at "${at} + 1")
  endforeach()
  set(${result} ${best} PARENT_SCOPE)
endfunction()

function(matterfit_room name)
  cmake_parse_arguments(ROOM "" "PART" "LINK;SOURCES;USES" ${ARGN})
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/native/${name}/*.cpp)
  file(GLOB_RECURSE tests CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/native/${name}/*_test.cpp)
  file(GLOB_RECURSE fuzzers CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/native/${name}/*_fuzz.cpp)
  file(GLOB mains CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/native/${name}/main.cpp)
  file(GLOB abi CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/native/${name}/matterfit_abi.cpp)
  if(tests)
    list(REMOVE_ITEM sources ${tests})
  endif()
  foreach(file IN LISTS fuzzers mains abi)
    list(REMOVE_ITEM sources ${file})
  endforeach()
  set(fuzzed matterfit_${name})
  if(ROOM_PART)
    set(part ${name}_${ROOM_PART})
    set(part_sources ${ROOM_SOURCES})
    list(TRANSFORM part_sources PREPEND ${CMAKE_SOURCE_DIR}/native/${name}/)
    set(part_tests ${part_sources})
    list(TRANSFORM part_sources APPEND .cpp)
    list(TRANSFORM part_tests APPEND _test.cpp)
    list(REMOVE_ITEM sources ${part_sources})
    set(room_tests ${tests})
    if(tests)
      list(REMOVE_ITEM tests ${part_tests})
      list(REMOVE_ITEM room_tests ${tests})
    endif()
    add_library(matterfit_${part} STATIC ${part_sources})
    target_precompile_headers(matterfit_${part} REUSE_FROM matterfit_precompiled)
    target_include_directories(matterfit_${part} PUBLIC ${CMAKE_SOURCE_DIR}/native)
    target_link_libraries(matterfit_${part} PUBLIC matterfit_flags)
    matterfit_link(matterfit_${part} PUBLIC ${ROOM_USES})
    matterfit_test(${part} ${room_tests})
    list(PREPEND ROOM_LINK ${part})
    set(fuzzed matterfit_${part})
  endif()
  if(sources)
    add_library(matterfit_${name} STATIC ${sources})
    target_precompile_headers(matterfit_${name} REUSE_FROM matterfit_precompiled)
    set(scope PUBLIC)
  else()
    add_library(matterfit_${name} INTERFACE)
    set(scope INTERFACE)
  endif()
  target_include_directories(matterfit_${name} ${scope} ${CMAKE_SOURCE_DIR}/native)
  target_link_libraries(matterfit_${name} ${scope} matterfit_flags)
  matterfit_link(matterfit_${name} ${scope} ${ROOM_LINK})
  matterfit_test(${name} ${tests})
  if(TARGET test_${name} AND TARGET test_${part})
    # Whoever asks for a room's tests gets those of its part.
    add_dependencies(test_${name} test_${part})
  endif()
  if(MATTERFIT_FUZZ AND fuzzers)
    target_compile_options(${fuzzed} PRIVATE ${MATTERFIT_COVERAGE})
    foreach(file IN LISTS fuzzers)
      get_filename_component(fuzzer ${file} NAME_WE)
      add_executable(${fuzzer} ${file})
      target_link_libraries(${fuzzer} PRIVATE ${fuzzed})
      target_compile_options(${fuzzer} PRIVATE ${MATTERFIT_COVERAGE})
      target_link_options(${fuzzer} PRIVATE -fsanitize=fuzzer,address)
    endforeach()
  endif()
endfunction()

# The tool, the shared library behind the C ABI, and the benchmarks.
function(matterfit_binaries)
  if(EXISTS ${CMAKE_SOURCE_DIR}/native/capi/matterfit_abi.cpp)
    add_library(matterfit SHARED ${CMAKE_SOURCE_DIR}/native/capi/matterfit_abi.cpp)
    target_link_libraries(matterfit PRIVATE matterfit_capi)
    target_link_options(matterfit PRIVATE -Wl,--as-needed
      -Wl,--version-script=${CMAKE_SOURCE_DIR}/cmake/matterfit.map)
    set_target_properties(matterfit PROPERTIES LINK_DEPENDS ${CMAKE_SOURCE_DIR}/cmake/matterfit.map)
    if(NOT MATTERFIT_SANITIZE)
      target_link_options(matterfit PRIVATE -Wl,--no-undefined)
    endif()
  endif()
  # A C program that uses the library, compiled as C99 and run as a test.
  if(MATTERFIT_TESTS AND TARGET matterfit)
    add_executable(capi_tutorial ${CMAKE_SOURCE_DIR}/native/capi/tutorial.c)
    set_target_properties(capi_tutorial PROPERTIES C_STANDARD 99 C_EXTENSIONS OFF)
    target_compile_options(capi_tutorial PRIVATE -Wall -Wextra -Wpedantic -Wconversion)
    target_include_directories(capi_tutorial PRIVATE ${CMAKE_SOURCE_DIR}/native)
    target_link_libraries(capi_tutorial PRIVATE matterfit)
    if(MATTERFIT_SANITIZE)
      # The sanitizers' runtime must come with the program, not with a library of it.
      target_link_options(capi_tutorial PRIVATE -fsanitize=address,undefined)
      set_target_properties(capi_tutorial PROPERTIES LINKER_LANGUAGE CXX)
    endif()
    if(TARGET test_capi)
      add_dependencies(test_capi capi_tutorial)
    endif()
  endif()
  if(EXISTS ${CMAKE_SOURCE_DIR}/native/capi/main.cpp)
    add_executable(matterfit_tool ${CMAKE_SOURCE_DIR}/native/capi/main.cpp)
    set_target_properties(matterfit_tool PROPERTIES OUTPUT_NAME matterfit)
    target_link_libraries(matterfit_tool PRIVATE matterfit_capi)
    target_link_options(matterfit_tool PRIVATE -Wl,--as-needed)
  endif()
  if(MATTERFIT_BENCH)
    file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/native/bench/*_bench.cpp)
    add_library(matterfit_bench STATIC ${CMAKE_SOURCE_DIR}/native/bench/probe.cpp
      ${CMAKE_SOURCE_DIR}/native/bench/serial_mpm.cpp
      ${CMAKE_SOURCE_DIR}/native/bench/serial_splat.cpp)
    # The yardsticks get what a compiler alone can do with plain code on this very machine.
    set_source_files_properties(${CMAKE_SOURCE_DIR}/native/bench/serial_mpm.cpp
      ${CMAKE_SOURCE_DIR}/native/bench/serial_splat.cpp PROPERTIES
      COMPILE_OPTIONS "-O3;-march=native")
    matterfit_link(matterfit_bench PUBLIC splat)
    # The stranger of the five-material set.
    set(reference reference_law reference_mpm reference_shape material_set)
    list(TRANSFORM reference PREPEND ${CMAKE_SOURCE_DIR}/native/bench/)
    list(TRANSFORM reference APPEND .cpp)
    add_library(matterfit_reference STATIC ${reference})
    target_include_directories(matterfit_reference PUBLIC ${CMAKE_SOURCE_DIR}/native)
    target_compile_options(matterfit_reference PRIVATE -O3)
    matterfit_link(matterfit_reference PUBLIC base)
    # Programs are built when they are named: `make test` has an hour.
    add_executable(five_materials EXCLUDE_FROM_ALL ${CMAKE_SOURCE_DIR}/native/bench/five_materials.cpp)
    matterfit_link(five_materials PRIVATE reference capture_readers CLI11::CLI11
      nlohmann_json::nlohmann_json)
    matterfit_test(reference ${CMAKE_SOURCE_DIR}/native/bench/reference_law_test.cpp
      ${CMAKE_SOURCE_DIR}/native/bench/reference_mpm_test.cpp)
    # Elastic bodies of any shape.
    add_library(matterfit_solids STATIC ${CMAKE_SOURCE_DIR}/native/bench/random_solids.cpp)
    matterfit_link(matterfit_solids PUBLIC capture)
    matterfit_test(bench ${CMAKE_SOURCE_DIR}/native/bench/serial_mpm_test.cpp
      ${CMAKE_SOURCE_DIR}/native/bench/serial_splat_test.cpp)
    matterfit_test(solids ${CMAKE_SOURCE_DIR}/native/bench/random_solids_test.cpp)
    foreach(file IN LISTS sources)
      get_filename_component(bench ${file} NAME_WE)
      add_executable(${bench} EXCLUDE_FROM_ALL ${file})
      matterfit_link(${bench} PRIVATE bench CLI11::CLI11)
      if(NOT bench STREQUAL splat_bench)
        matterfit_link(${bench} PRIVATE mpm)
      endif()
    endforeach()
    matterfit_link(random_solids_bench PRIVATE solids)
  endif()
endfunction()
