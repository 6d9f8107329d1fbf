#include "understory/pipeline/run_folder/run_json.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>

#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"

namespace understory {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using Pointer = Json::json_pointer;

constexpr std::uintmax_t kMostBytes = 64U << 20;

template <std::size_t N>
bool is_one_of(const std::string& text, const std::array<const char*, N>& names) {
  return std::find(names.begin(), names.end(), text) != names.end();
}

// Null where there is nothing.
const Json& value_at(const Json& json, const std::string& place) {
  static const Json kNothing;
  const Pointer pointer(place);
  return json.contains(pointer) ? json.at(pointer) : kNothing;
}

}  // namespace

struct RunJson::Content {
  fs::path path;
  bool present = false;
  Json json;

  [[nodiscard]] InputError wrong(const std::string& place, const std::string& expected) const {
    return {path.string(), place, "expected " + expected};
  }
};

RunJson::RunJson(const fs::path& folder) : content_(std::make_unique<Content>()) {
  content_->path = folder / kName;
  std::error_code error;
  content_->present = fs::is_regular_file(fs::status(content_->path, error));
  if (!content_->present) return;
  if (fs::file_size(content_->path, error) > kMostBytes || error) return;
  std::ifstream file(content_->path);
  content_->json = Json::parse(file, nullptr, false);
}

RunJson::~RunJson() = default;
RunJson::RunJson(RunJson&&) noexcept = default;
RunJson& RunJson::operator=(RunJson&&) noexcept = default;

bool RunJson::is_present() const {
  return content_->present;
}
bool RunJson::is_object() const {
  return content_->json.is_object();
}

bool RunJson::is_ours() const {
  constexpr std::array<const char*, 5> kCommands = {"map", "correct", "inventory", "georeference",
                                                    "merge"};
  constexpr std::array<const char*, 3> kStatus = {"complete", "partial", "untrusted"};
  return is_one_of(find_text("/command"), kCommands) && is_one_of(find_text("/status"), kStatus) &&
         !find_text("/version").empty();
}

bool RunJson::has(const std::string& place) const {
  return content_->json.contains(Pointer(place));
}

double RunJson::find_number(const std::string& place) const {
  const Json& value = value_at(content_->json, place);
  return value.is_number() ? value.get<double>() : std::nan("");
}

std::string RunJson::find_text(const std::string& place) const {
  const Json& value = value_at(content_->json, place);
  return value.is_string() ? value.get<std::string>() : std::string();
}

std::vector<std::string> RunJson::find_texts(const std::string& place) const {
  std::vector<std::string> texts;
  const Json& list = value_at(content_->json, place);
  if (!list.is_array()) return texts;
  for (const Json& value : list)
    if (value.is_string()) texts.push_back(value.get<std::string>());
  return texts;
}

std::vector<std::string> RunJson::find_texts_of(const std::string& place,
                                                const std::string& key) const {
  std::vector<std::string> texts;
  const Json& list = value_at(content_->json, place);
  if (!list.is_array()) return texts;
  for (const Json& object : list) {
    const auto value = object.is_object() ? object.find(key) : object.end();
    if (value != object.end() && value->is_string()) texts.push_back(value->get<std::string>());
  }
  return texts;
}

bool RunJson::get_flag(const std::string& place) const {
  const Json& value = value_at(content_->json, place);
  if (!value.is_boolean()) throw content_->wrong(place, "true or false");
  return value.get<bool>();
}

double RunJson::get_number(const std::string& place) const {
  const double number = find_number(place);
  if (std::isnan(number)) throw content_->wrong(place, "a number");
  return number;
}

std::vector<double> RunJson::get_numbers(const std::string& place, std::size_t count) const {
  const InputError wrong = content_->wrong(place, std::to_string(count) + " numbers");
  const Json& list = value_at(content_->json, place);
  if (!list.is_array() || list.size() != count) throw wrong;
  std::vector<double> numbers;
  for (const Json& value : list) {
    if (!value.is_number() && !value.is_null()) throw wrong;
    numbers.push_back(value.is_null() ? std::nan("") : value.get<double>());
  }
  return numbers;
}

Pose RunJson::get_pose(const std::string& place) const {
  const std::vector<double> t = get_numbers(place + "/translation_m", 3);
  const std::vector<double> q = get_numbers(place + "/rotation_xyzw", 4);
  if (std::isnan(t[0] + t[1] + t[2] + q[0] + q[1] + q[2] + q[3]))
    throw content_->wrong(place, "a pose of finite numbers");
  return Pose::from_unit(Eigen::Quaterniond(q[3], q[0], q[1], q[2]), {t[0], t[1], t[2]});
}

void write_file_list(const fs::path& folder, const std::set<std::string>& names) {
  UNDERSTORY_CHECK(RunJson(folder).is_ours());
  const fs::path path = folder / RunJson::kName;
  std::ifstream former(path);
  Json json = Json::parse(former);
  json["files"] = names;
  AtomicFile file(path);
  file.write(json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  file.commit();
}

}  // namespace understory
