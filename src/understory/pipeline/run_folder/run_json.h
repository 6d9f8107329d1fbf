#pragma once

#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"

namespace understory {

// The run.json of a folder, as all commands read it again. Places in it are JSON pointers:
// "/quality/area_m2". What is asked for by `find_` may be missing; what is asked for by `get_`
// throws an InputError that names the file and the place.
class RunJson {
 public:
  static constexpr const char* kName = "run.json";

  // Reads `folder`/run.json. Never throws: see is_present and is_object. Anything but a regular
  // file is taken as missing (a pipe would be waited for), one of over 64 MiB as unreadable.
  explicit RunJson(const std::filesystem::path& folder);
  ~RunJson();
  RunJson(RunJson&&) noexcept;
  RunJson& operator=(RunJson&&) noexcept;

  [[nodiscard]] bool is_present() const;  // a regular file of that name is there
  [[nodiscard]] bool is_object() const;   // and it holds a JSON object
  // And a command of this program wrote it: other programs write files of that name, too.
  [[nodiscard]] bool is_ours() const;

  [[nodiscard]] bool has(const std::string& place) const;
  // NaN where there is no number.
  [[nodiscard]] double find_number(const std::string& place) const;
  // Empty where there is no text.
  [[nodiscard]] std::string find_text(const std::string& place) const;
  // The texts of a list; whatever else the list holds is left out.
  [[nodiscard]] std::vector<std::string> find_texts(const std::string& place) const;
  // A text of each object in a list, of those that have it: find_texts_of("/inputs", "file").
  [[nodiscard]] std::vector<std::string> find_texts_of(const std::string& place,
                                                       const std::string& key) const;

  [[nodiscard]] bool get_flag(const std::string& place) const;
  [[nodiscard]] double get_number(const std::string& place) const;
  // A list of exactly `count` numbers; null stands for NaN, as the program writes it.
  [[nodiscard]] std::vector<double> get_numbers(const std::string& place, std::size_t count) const;
  // An object of translation_m (x, y, z) and rotation_xyzw (a unit quaternion).
  [[nodiscard]] Pose get_pose(const std::string& place) const;

 private:
  struct Content;
  std::unique_ptr<Content> content_;
};

// Writes the list `files` into a run.json of this program, anew. Throws OutputError.
void write_file_list(const std::filesystem::path& folder, const std::set<std::string>& names);

}  // namespace understory
