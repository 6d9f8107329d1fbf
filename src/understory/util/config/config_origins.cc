#include "understory/util/config/config_origins.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <sstream>

#include "understory/util/error.h"

namespace understory {
namespace {

const ConfigTable::Field* find(const ConfigTable& table, const std::string& key) {
  const auto& fields = table.fields();
  const auto found = std::find_if(fields.begin(), fields.end(),
                                  [&](const auto& field) { return field.key == key; });
  return found == fields.end() ? nullptr : &*found;
}

const ConfigTable::Field& get(const ConfigTable& table, const std::string& key) {
  const ConfigTable::Field* field = find(table, key);
  UNDERSTORY_CHECK(field != nullptr);
  return *field;
}

void note(const ConfigTable& table, const YAML::Node& node, const std::string& path,
          const std::string& origin, ConfigOrigins& origins) {
  for (const auto& entry : node) {
    const auto name = entry.first.as<std::string>();
    const std::string key = path.empty() ? name : path + "." + name;
    if (entry.second.IsMap()) {
      note(table, entry.second, key, origin, origins);
    } else if (find(table, key) != nullptr) {
      origins[key] = origin;
    }
  }
}

}  // namespace

ConfigOrigins read_settings(ConfigTable& table, const std::string& file,
                            const std::vector<std::string>& settings) {
  ConfigOrigins origins;
  if (!file.empty()) {
    table.read_file(file);
    note_file(table, file, origins);
  }
  table.set(settings);
  note_settings(table, settings, origins);
  return origins;
}

void note_yaml(const ConfigTable& table, const std::string& text, const std::string& origin,
               ConfigOrigins& origins) {
  note(table, YAML::Load(text), "", origin, origins);
}

void note_file(const ConfigTable& table, const std::string& path, ConfigOrigins& origins) {
  note(table, YAML::LoadFile(path), "", path, origins);
}

void note_settings(const ConfigTable& table, const std::vector<std::string>& settings,
                   ConfigOrigins& origins) {
  for (const std::string& setting : settings) {
    const std::string key = setting.substr(0, setting.find('='));
    if (find(table, key) != nullptr) origins[key] = "--set";
  }
}

std::string value_of(const ConfigTable& table, const std::string& key) {
  return get(table, key).get();
}

void set_value(const ConfigTable& table, const std::string& key, const std::string& value) {
  UNDERSTORY_CHECK(get(table, key).set(value).empty());
}

std::string yaml_with_remarks(const ConfigTable& table,
                              const std::map<std::string, std::string>& remarks) {
  std::istringstream lines(table.to_yaml(true));
  std::string text;
  auto field = table.fields().begin();
  for (std::string line; std::getline(lines, line);) {
    const std::size_t meaning =
        field == table.fields().end() ? line.npos : line.find("# " + field->meaning);
    if (meaning != line.npos) {
      const auto remark = remarks.find(field->key);
      if (remark != remarks.end()) line.insert(meaning + 2, remark->second + ". ");
      ++field;
    }
    text += line + "\n";
  }
  UNDERSTORY_CHECK(field == table.fields().end());
  return text;
}

}  // namespace understory
