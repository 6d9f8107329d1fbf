#pragma once

#include <string>

#include "understory/cli/command.h"
#include "understory/evaluation/map_entropy.h"

namespace understory {

// `understory evaluate map RUN|CLOUD`: the entropy of the cloud. Returns the exit code.
[[nodiscard]] int evaluate_crispness(const std::string& run_or_cloud,
                                     const MapEntropyConfig& config, bool json,
                                     CommandContext& context);

}  // namespace understory
