#pragma once

#include <array>

#include "understory/features/stem_chain.h"

namespace understory {

// What tells a stem from branches, plants and chance: one number each, about 0 to 3.
using StemTraits = std::array<double, 15>;
[[nodiscard]] StemTraits stem_traits(const SectionView& view, const StemChain& chain,
                                     const StemChainConfig& config, double lowest_above_ground_m);

// Probability that a chain with these traits is a stem, by logistic regression.
[[nodiscard]] double stem_score(const StemTraits& traits);

}  // namespace understory
