#pragma once

#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "understory/registration/gaussian/gaussian_matcher.h"
#include "understory/registration/gicp/gicp_matcher.h"
#include "understory/registration/icp/icp_matcher.h"
#include "understory/registration/loam/loam_matcher.h"
#include "understory/registration/matcher.h"
#include "understory/registration/ndt/ndt_matcher.h"
#include "understory/registration/ndt_d2d/ndt_d2d_matcher.h"
#include "understory/registration/vgicp/vgicp_matcher.h"
#include "understory/util/config/config.h"

namespace understory {

// The methods there are, by their configurations: a new one is a line here. A configuration C is an
// aggregate with
//   static constexpr const char* kName, kSummary;                  "ndt", and a few words of help
//   static constexpr FitnessNoise kFitnessNoise;                   how its errors grow
//   void describe(ConfigTable&, C&);                               the settings in section kName
//   std::unique_ptr<const Matcher> make_matcher(const C&);         throws ConfigError
//   std::vector<SuitedSetting> suited_settings(const C&, const ScanTraits&);
using MatcherConfigs = std::tuple<NdtMatcherConfig,          //
                                  NdtD2dMatcherConfig,       //
                                  IcpMatcherConfig,          //
                                  GicpMatcherConfig,         //
                                  VgicpMatcherConfig,        //
                                  PointToGaussianConfig,     //
                                  GaussianToGaussianConfig,  //
                                  LoamMatcherConfig,         //
                                  LoamGroundMatcherConfig>;

// The method chosen, and the settings of all of them.
struct MatcherConfig {
  std::string method = NdtMatcherConfig::kName;
  MatcherConfigs of;

  template <typename Config>
  [[nodiscard]] Config& get() {
    return std::get<Config>(of);
  }
  template <typename Config>
  [[nodiscard]] const Config& get() const {
    return std::get<Config>(of);
  }
};

// Names of the methods, and "name (summary), ..." for help texts.
[[nodiscard]] std::vector<std::string> matcher_names();
[[nodiscard]] std::string matcher_summaries(const std::string& between = ", ");

// The key `method` and one section for each method's settings; or those sections alone.
void describe(ConfigTable& table, MatcherConfig& config);
void describe_settings(ConfigTable& table, MatcherConfig& config);

// The chosen method, or another one with its settings. Throws ConfigError for an unknown name or
// settings that cannot be.
[[nodiscard]] std::unique_ptr<const Matcher> make_matcher(const MatcherConfig& config);
[[nodiscard]] std::unique_ptr<const Matcher> make_matcher(const MatcherConfig& config,
                                                          const std::string& method);

// How the errors of the chosen method grow with the fitness of its matches.
[[nodiscard]] FitnessNoise fitness_noise(const MatcherConfig& config);

// Settings of the chosen method that suit such scans better than those in `config`; keys begin with
// the method's section.
[[nodiscard]] std::vector<SuitedSetting> suited_settings(const MatcherConfig& config,
                                                         const ScanTraits& traits);

}  // namespace understory
