#pragma once

#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "understory/util/error.h"

namespace understory {

// The table of a configuration's fields: one entry per key, bound to the variable that holds its
// value. Reading YAML, `--set`, `--print-config` and the documentation are all made from it.
//
// A component writes
//     struct Config { double voxel_size_m = 0.5; ... };
//     void describe(ConfigTable& table, Config& config);   // table.add("voxel_size_m", ...)
// and the pipeline nests it: table.section("registration", [&] { describe(table, config); }).
// Keys carry their unit (`voxel_size_m`). The bound variables must outlive the table.
class ConfigTable {
 public:
  struct Range {
    double low = -std::numeric_limits<double>::infinity();
    double high = std::numeric_limits<double>::infinity();
  };
  struct Field {
    std::string key;    // full path, "registration.voxel_size_m"
    std::string type;   // "number", "integer", "bool", "text", "choice", "numbers"
    std::string unit;   // "m", "deg", "" for none
    std::string range;  // "0.05..10", "ndt|gicp", "" for any
    std::string meaning;
    std::string value_default;                           // as YAML, taken when the field was added
    std::function<std::string()> get;                    // current value as YAML
    std::function<std::string(const std::string&)> set;  // problem, or empty
    std::function<std::string(const std::vector<std::string>&)> set_list;  // empty if no list
  };

  void section(const std::string& name, const std::function<void()>& fields);

  void add(const std::string& key, double& value, Range range, const std::string& unit,
           const std::string& meaning);
  void add(const std::string& key, int& value, Range range, const std::string& unit,
           const std::string& meaning);
  void add(const std::string& key, bool& value, const std::string& meaning);
  void add(const std::string& key, std::string& value, const std::string& meaning);
  void add(const std::string& key, std::vector<double>& value, const std::string& unit,
           const std::string& meaning);
  // A text field restricted to `choices`.
  void add_choice(const std::string& key, std::string& value,
                  const std::vector<std::string>& choices, const std::string& meaning);
  // An enumeration written as one of the names.
  template <typename Enum>
  void add_enum(const std::string& key, Enum& value,
                const std::vector<std::pair<std::string, Enum>>& names, const std::string& meaning);

  [[nodiscard]] const std::vector<Field>& fields() const { return fields_; }

  // Reads YAML text or a file into the bound variables. Unknown keys (with the nearest known one as
  // a hint), wrong types and values out of range are all gathered into one ConfigError. `origin`
  // (file name) is put before each. With `passed_over` unknown keys are no problem and are told
  // there.
  void read_yaml(const std::string& text, const std::string& origin,
                 std::vector<std::string>* passed_over = nullptr);
  void read_file(const std::string& path);
  // Applies "key=value" settings; all problems in one ConfigError.
  void set(const std::vector<std::string>& settings);
  // All keys as YAML, each with default, unit, range and meaning as a comment if `commented`.
  [[nodiscard]] std::string to_yaml(bool commented) const;

 private:
  struct EnumAccess {
    std::function<std::string()> get;
    std::function<void(std::size_t)> set;
  };
  void add_named(const std::string& key, const std::vector<std::string>& names, EnumAccess access,
                 const std::string& meaning);
  void add_field(Field field);
  [[nodiscard]] Field* find(const std::string& key);
  [[nodiscard]] std::string unknown(const std::string& key) const;
  friend class ConfigReader;

  std::string prefix_;
  std::vector<Field> fields_;
};

// The problems of several readings of one configuration (profile, file, settings), so that the user
// sees all of them at once. Not thread-safe.
class ConfigProblems {
 public:
  // Runs `read` and keeps what its ConfigError tells; any other exception passes.
  template <typename Read>
  void gather(const Read& read) {
    try {
      read();
    } catch (const ConfigError& error) {
      all_.insert(all_.end(), error.problems().begin(), error.problems().end());
    }
  }
  // One ConfigError of everything gathered, in its order; nothing where there is nothing.
  void throw_if_any() const {
    if (!all_.empty()) throw ConfigError(all_);
  }

 private:
  std::vector<std::string> all_;
};

template <typename Enum>
void ConfigTable::add_enum(const std::string& key, Enum& value,
                           const std::vector<std::pair<std::string, Enum>>& names,
                           const std::string& meaning) {
  std::vector<std::string> texts;
  for (const auto& [text, which] : names)
    texts.push_back(text);
  add_named(key, texts,
            {[&value, names] {
               for (const auto& [text, which] : names) {
                 if (which == value) return text;
               }
               return std::string("?");
             },
             [&value, names](std::size_t i) { value = names[i].second; }},
            meaning);
}

}  // namespace understory
