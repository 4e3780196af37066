# SPDX-License-Identifier: GPL-3.0-or-later
# cmake -DFILES=a;b;… -DNAME=kX -DOUTPUT=x.hpp -P HashSources.cmake: one hash of the contents of many
# files, as a C++ constant. States are taken again only by the code that made them.
set(all "")
foreach(file IN LISTS FILES)
  file(SHA256 ${file} hash)
  get_filename_component(name ${file} NAME)
  string(APPEND all "${name} ${hash}\n")
endforeach()
string(SHA256 hash "${all}")
string(SUBSTRING ${hash} 0 16 hash)
file(WRITE ${OUTPUT}
"// SPDX-License-Identifier: GPL-3.0-or-later
// Made by cmake/HashSources.cmake.
#pragma once
namespace matterfit::job {
inline constexpr const char* ${NAME} = \"${hash}\";
}
")
