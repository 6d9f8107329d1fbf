#pragma once

#include <map>
#include <string>
#include <vector>

#include "understory/util/config/config.h"

namespace understory {

// By what each key was set that was: "profile handheld", the name of a file, "--set". Keys that are
// not in it have their defaults.
using ConfigOrigins = std::map<std::string, std::string>;

// A configuration put together, and which of its keys the user set.
template <typename Config>
struct ReadConfig {
  Config config;
  ConfigOrigins origins;
};

// A value that the program changed to suit the sensor or the way of running.
struct ConfigAdaptation {
  std::string key;
  std::string from;  // as YAML, like `to`
  std::string to;
  double when_s = 0.0;  // of recording since the first scan; 0: before it
  std::string why;
};

// A configuration as run.json tells it.
struct ConfigRecord {
  std::string asked_yaml;      // what was asked for, every key
  ConfigOrigins origins;       // which of them were set, by what
  std::string effective_yaml;  // what ran; empty: as asked for
  std::vector<ConfigAdaptation> adapted;
};

// Reads a file into `table`, none where its name is empty, and then settings ("key=value"). Returns
// the origins of the keys that they set. Throws ConfigError, InputError.
[[nodiscard]] ConfigOrigins read_settings(ConfigTable& table, const std::string& file,
                                          const std::vector<std::string>& settings);

// Notes the keys of `table` that YAML text, a file or settings ("key=value") have set: what comes
// later replaces what comes before. They have been read into the table without a problem; keys that
// it does not have are passed over.
void note_yaml(const ConfigTable& table, const std::string& text, const std::string& origin,
               ConfigOrigins& origins);
void note_file(const ConfigTable& table, const std::string& path, ConfigOrigins& origins);
void note_settings(const ConfigTable& table, const std::vector<std::string>& settings,
                   ConfigOrigins& origins);

// Value of a key that is there, as YAML.
[[nodiscard]] std::string value_of(const ConfigTable& table, const std::string& key);
// Sets a key that is there to a value (YAML) within its range.
void set_value(const ConfigTable& table, const std::string& key, const std::string& value);

// All keys as `to_yaml(true)` has them; what `remarks` says of a key stands before its meaning.
[[nodiscard]] std::string yaml_with_remarks(const ConfigTable& table,
                                            const std::map<std::string, std::string>& remarks);

}  // namespace understory
