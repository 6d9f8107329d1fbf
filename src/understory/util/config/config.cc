#include "understory/util/config/config.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>

#include "understory/util/error.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

std::string number_text(double value) {
  std::string text = fmt::format("{}", value);
  if (text == "inf") return ".inf";
  if (text == "-inf") return "-.inf";
  return text;
}

std::string range_text(const ConfigTable::Range& range) {
  if (std::isinf(range.low) && std::isinf(range.high)) return "";
  if (std::isinf(range.high)) return ">= " + number_text(range.low);
  if (std::isinf(range.low)) return "<= " + number_text(range.high);
  return number_text(range.low) + ".." + number_text(range.high);
}

bool parse_number(const std::string& text, double& value) {
  try {
    value = YAML::Load(text).as<double>();
    return !std::isnan(value);
  } catch (const YAML::Exception&) {
    return false;
  }
}

std::string out_of_range(const std::string& text, const ConfigTable::Range& range,
                         const std::string& unit) {
  return "is " + text + ", expected " + range_text(range) + (unit.empty() ? "" : " " + unit);
}

std::string in_quotes(const std::string& text) {
  YAML::Emitter out;
  out << YAML::DoubleQuoted << text;
  return out.c_str();
}

std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

}  // namespace

// Walks a YAML document and gathers what is wrong with it.
class ConfigReader {
 public:
  ConfigReader(ConfigTable& table, std::string origin, std::vector<std::string>* passed_over)
      : table_(table), origin_(std::move(origin)), passed_over_(passed_over) {}

  void read(const YAML::Node& node, const std::string& path) {
    for (const auto& entry : node) {
      const auto name = entry.first.as<std::string>();
      const std::string key = path.empty() ? name : path + "." + name;
      const int line = entry.first.Mark().line + 1;
      if (entry.second.IsMap()) {
        read(entry.second, key);
      } else {
        assign(key, entry.second, line);
      }
    }
  }

  std::vector<std::string> problems;

 private:
  void assign(const std::string& key, const YAML::Node& node, int line) {
    ConfigTable::Field* field = table_.find(key);
    std::string problem;
    if (field == nullptr && passed_over_ != nullptr) {
      passed_over_->push_back(key);
    } else if (field == nullptr) {
      problem = table_.unknown(key);
    } else if (node.IsSequence()) {
      problem = assign_list(*field, node);
    } else if (node.IsScalar()) {
      problem = field->set(node.as<std::string>());
    } else {
      problem = "has no value";
    }
    if (!problem.empty()) {
      problems.push_back(fmt::format("{}:{}: {}: {}", origin_, line, key, problem));
    }
  }

  static std::string assign_list(const ConfigTable::Field& field, const YAML::Node& node) {
    if (!field.set_list) return "expected one value (" + field.type + "), found a list";
    std::vector<std::string> items;
    for (const auto& item : node) {
      if (!item.IsScalar()) return "expected a list of plain values";
      items.push_back(item.as<std::string>());
    }
    return field.set_list(items);
  }

  ConfigTable& table_;
  std::string origin_;
  std::vector<std::string>* passed_over_;
};

void ConfigTable::section(const std::string& name, const std::function<void()>& fields) {
  const std::string outer = prefix_;
  prefix_ += name + ".";
  fields();
  prefix_ = outer;
}

void ConfigTable::add_field(Field field) {
  field.key = prefix_ + field.key;
  UNDERSTORY_CHECK(find(field.key) == nullptr);
  field.value_default = field.get();
  fields_.push_back(std::move(field));
}

void ConfigTable::add(const std::string& key, double& value, Range range, const std::string& unit,
                      const std::string& meaning) {
  const auto set = [&value, range, unit](const std::string& text) -> std::string {
    double number = 0.0;
    if (!parse_number(text, number)) return "is \"" + text + "\", expected a number";
    if (number < range.low || number > range.high) return out_of_range(text, range, unit);
    value = number;
    return "";
  };
  add_field({key, "number", unit, range_text(range), meaning, "",
             [&value] { return number_text(value); }, set, nullptr});
}

void ConfigTable::add(const std::string& key, int& value, Range range, const std::string& unit,
                      const std::string& meaning) {
  const auto set = [&value, range, unit](const std::string& text) -> std::string {
    double number = 0.0;
    if (!parse_number(text, number) || number != std::floor(number) || std::abs(number) > 2e9) {
      return "is \"" + text + "\", expected a whole number";
    }
    if (number < range.low || number > range.high) return out_of_range(text, range, unit);
    value = static_cast<int>(number);
    return "";
  };
  add_field({key, "integer", unit, range_text(range), meaning, "",
             [&value] { return std::to_string(value); }, set, nullptr});
}

void ConfigTable::add(const std::string& key, bool& value, const std::string& meaning) {
  const auto set = [&value](const std::string& text) -> std::string {
    if (text != "true" && text != "false") return "is \"" + text + "\", expected true or false";
    value = text == "true";
    return "";
  };
  add_field({key, "bool", "", "true|false", meaning, "",
             [&value] { return std::string(value ? "true" : "false"); }, set, nullptr});
}

void ConfigTable::add(const std::string& key, std::string& value, const std::string& meaning) {
  const auto set = [&value](const std::string& text) -> std::string {
    value = text;
    return "";
  };
  add_field(
      {key, "text", "", "", meaning, "", [&value] { return in_quotes(value); }, set, nullptr});
}

void ConfigTable::add(const std::string& key, std::vector<double>& value, const std::string& unit,
                      const std::string& meaning) {
  const auto set_list = [&value](const std::vector<std::string>& texts) -> std::string {
    std::vector<double> numbers(texts.size());
    for (std::size_t i = 0; i < texts.size(); ++i) {
      if (!parse_number(texts[i], numbers[i])) {
        return "is \"" + texts[i] + "\" at place " + std::to_string(i + 1) + ", expected a number";
      }
    }
    value = numbers;
    return "";
  };
  const auto set = [set_list](const std::string& text) -> std::string {
    try {
      const YAML::Node node = YAML::Load(text);
      if (node.IsSequence()) return set_list(node.as<std::vector<std::string>>());
    } catch (const YAML::Exception&) {  // reported below, with all other wrong types
    }
    return "is \"" + text + "\", expected a list of numbers like [1, 2, 3]";
  };
  const auto get = [&value] {
    std::string text = "[";
    for (const double number : value)
      text += (text.size() > 1 ? ", " : "") + number_text(number);
    return text + "]";
  };
  add_field({key, "numbers", unit, "", meaning, "", get, set, set_list});
}

void ConfigTable::add_choice(const std::string& key, std::string& value,
                             const std::vector<std::string>& choices, const std::string& meaning) {
  add_named(key, choices,
            {[&value] { return value; }, [&value, choices](std::size_t i) { value = choices[i]; }},
            meaning);
}

void ConfigTable::add_named(const std::string& key, const std::vector<std::string>& names,
                            EnumAccess access, const std::string& meaning) {
  std::string range;
  for (const std::string& name : names)
    range += (range.empty() ? "" : "|") + name;
  const auto set = [names, range, access](const std::string& text) -> std::string {
    const auto found = std::find(names.begin(), names.end(), text);
    if (found == names.end()) return "is \"" + text + "\", expected " + range;
    access.set(static_cast<std::size_t>(found - names.begin()));
    return "";
  };
  add_field({key, "choice", "", range, meaning, "", access.get, set, nullptr});
}

ConfigTable::Field* ConfigTable::find(const std::string& key) {
  for (Field& field : fields_) {
    if (field.key == key) return &field;
  }
  return nullptr;
}

std::string ConfigTable::unknown(const std::string& key) const {
  // `map` and `inventory` have settings in common, which `map` keeps in a section of its own.
  const auto same_ending = [&key](const Field& field) {
    return field.key.ends_with("." + key) || key.ends_with("." + field.key);
  };
  if (std::count_if(fields_.begin(), fields_.end(), same_ending) == 1)
    return "unknown key (did you mean " +
           std::find_if(fields_.begin(), fields_.end(), same_ending)->key + "?)";
  const Field* nearest = nullptr;
  std::size_t best = key.size() / 2 + 1;
  for (const Field& field : fields_) {
    const std::size_t distance = edit_distance(key, field.key);
    if (distance < best) {
      best = distance;
      nearest = &field;
    }
  }
  return nearest != nullptr
             ? "unknown key (did you mean " + nearest->key + "?)"
             : "unknown key (--print-config lists all, and --print-site those of a site)";
}

void ConfigTable::read_yaml(const std::string& text, const std::string& origin,
                            std::vector<std::string>* passed_over) {
  ConfigReader reader(*this, origin, passed_over);
  try {
    const YAML::Node root = load_yaml(text, origin);
    if (!root.IsNull() && !root.IsMap()) {
      throw ConfigError({origin + ": expected keys with values"});
    }
    reader.read(root, "");
  } catch (const YAML::Exception& error) {
    throw ConfigError({fmt::format("{}:{}: {}", origin, error.mark.line + 1, error.msg)});
  }
  if (!reader.problems.empty()) throw ConfigError(reader.problems);
}

void ConfigTable::read_file(const std::string& path) {
  read_yaml(read_text_file(path), path);
}

void ConfigTable::set(const std::vector<std::string>& settings) {
  std::vector<std::string> problems;
  for (const std::string& setting : settings) {
    const std::size_t equals = setting.find('=');
    if (equals == std::string::npos) {
      problems.push_back("--set " + setting + ": expected key=value");
      continue;
    }
    const std::string key = setting.substr(0, equals);
    Field* field = find(key);
    const std::string problem =
        field == nullptr ? unknown(key) : field->set(setting.substr(equals + 1));
    if (!problem.empty()) problems.push_back("--set " + key + ": " + problem);
  }
  if (!problems.empty()) throw ConfigError(problems);
}

std::string ConfigTable::to_yaml(bool commented) const {
  std::string text;
  std::vector<std::string> open;
  for (const Field& field : fields_) {
    std::vector<std::string> path;
    std::istringstream parts(field.key);
    for (std::string part; std::getline(parts, part, '.');)
      path.push_back(part);
    std::size_t common = 0;
    while (common < open.size() && common + 1 < path.size() && open[common] == path[common]) {
      ++common;
    }
    for (std::size_t i = common; i + 1 < path.size(); ++i) {
      text += std::string(2 * i, ' ') + path[i] + ":\n";
    }
    open.assign(path.begin(), path.end() - 1);
    const std::string line = std::string(2 * open.size(), ' ') + path.back() + ": " + field.get();
    text += line;
    if (commented) {
      text += std::string(line.size() < 44 ? 44 - line.size() : 1, ' ') + "# " + field.meaning;
      std::string facts = "default " + field.value_default;
      if (!field.unit.empty()) facts += ", " + field.unit;
      if (!field.range.empty()) facts += ", " + field.range;
      text += " (" + facts + ")";
    }
    text += "\n";
  }
  return text;
}

}  // namespace understory
