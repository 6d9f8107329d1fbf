#include "understory/registration/matchers.h"

#include "understory/util/error.h"

namespace understory {
namespace {

// Calls act(config) with each method's settings, in the order of the list.
template <typename Config, typename Act>
void for_each_method(Config& config, const Act& act) {
  std::apply([&](auto&... each) { (act(each), ...); }, config.of);
}

template <typename Config>
std::string name_of(const Config&) {
  return Config::kName;
}

}  // namespace

MatchTargetPtr Matcher::make_target(const Points& points) const {
  const std::unique_ptr<TargetBuilder> builder = make_builder({});
  builder->insert(points, Pose(), std::nullopt);
  return builder->snapshot();
}

std::vector<std::string> matcher_names() {
  std::vector<std::string> names;
  const MatcherConfig config;
  for_each_method(config, [&](const auto& each) { names.push_back(name_of(each)); });
  return names;
}

std::string matcher_summaries(const std::string& between) {
  std::string text;
  const MatcherConfig config;
  for_each_method(config, [&]<typename Config>(const Config&) {
    text += (text.empty() ? "" : between) + Config::kName + " (" + Config::kSummary + ")";
  });
  return text;
}

void describe(ConfigTable& table, MatcherConfig& config) {
  table.add_choice("method", config.method, matcher_names(),
                   "how points are matched. " + matcher_summaries(". "));
  describe_settings(table, config);
}

void describe_settings(ConfigTable& table, MatcherConfig& config) {
  for_each_method(
      config, [&](auto& each) { table.section(name_of(each), [&] { describe(table, each); }); });
}

std::unique_ptr<const Matcher> make_matcher(const MatcherConfig& config) {
  return make_matcher(config, config.method);
}

std::unique_ptr<const Matcher> make_matcher(const MatcherConfig& config,
                                            const std::string& method) {
  std::unique_ptr<const Matcher> matcher;
  for_each_method(config, [&](const auto& each) {
    if (name_of(each) == method) matcher = make_matcher(each);
  });
  if (matcher == nullptr) throw ConfigError({"method: unknown matcher \"" + method + "\""});
  return matcher;
}

FitnessNoise fitness_noise(const MatcherConfig& config) {
  FitnessNoise noise;
  for_each_method(config, [&]<typename Config>(const Config&) {
    if (config.method == Config::kName) noise = Config::kFitnessNoise;
  });
  return noise;
}

std::vector<SuitedSetting> suited_settings(const MatcherConfig& config, const ScanTraits& traits) {
  std::vector<SuitedSetting> suited;
  for_each_method(config, [&](const auto& each) {
    if (name_of(each) != config.method) return;
    suited = suited_settings(each, traits);
    for (SuitedSetting& setting : suited)
      setting.key = config.method + "." + setting.key;
  });
  return suited;
}

}  // namespace understory
