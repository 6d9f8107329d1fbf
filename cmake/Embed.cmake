# understory_embed(<output .cc> FUNCTION <name> TYPE <type> HEADER <header> FILES <file>...)
# Writes a source file that holds text files: `std::span<const TYPE> FUNCTION()` gives an array of
# {name without extension, text}.
function(understory_embed output)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "FUNCTION;TYPE;HEADER" "FILES")
  set(entries "")
  foreach(file IN LISTS arg_FILES)
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${file}")
    get_filename_component(name "${file}" NAME_WE)
    file(READ "${file}" text)
    string(APPEND entries "    {\"${name}\", R\"embedded(${text})embedded\"},\n")
  endforeach()
  file(CONFIGURE OUTPUT "${output}" @ONLY CONTENT
"// Made by cmake/Embed.cmake from text files.
#include \"@arg_HEADER@\"

#include <array>

namespace understory {

std::span<const @arg_TYPE@> @arg_FUNCTION@() {
  static constexpr auto kFiles = std::to_array<@arg_TYPE@>({
@entries@  });
  return kFiles;
}

}  // namespace understory
")
endfunction()
