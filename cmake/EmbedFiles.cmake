# SPDX-License-Identifier: GPL-3.0-or-later
# cmake -DFILES="a;b" -DOUTPUT=header -P EmbedFiles.cmake: a header with the bytes of small files, each
# under the stem of its name.
set(arrays "")
set(rows "")
foreach(file IN LISTS FILES)
  get_filename_component(name ${file} NAME_WE)
  file(READ ${file} hex HEX)
  string(LENGTH "${hex}" digits)
  math(EXPR size "${digits} / 2")
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
  string(APPEND arrays "inline constexpr unsigned char k_${name}[] = {\n    ${bytes}};\n")
  string(APPEND rows "    {\"${name}\", k_${name}, ${size}},\n")
endforeach()
set(text "// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace matterfit::job {

struct NeuralStartFile {
  std::string_view name;
  const unsigned char* bytes;
  std::size_t size;
};
${arrays}
inline constexpr NeuralStartFile kNeuralStartFiles[] = {
${rows}};

}  // namespace matterfit::job
")
file(WRITE ${OUTPUT} "${text}")
