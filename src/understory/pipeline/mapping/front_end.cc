#include "understory/pipeline/mapping/front_end.h"

#include "understory/pipeline/mapping/dense/dense_front_end.h"
#include "understory/pipeline/mapping/sparse/sparse_front_end.h"

namespace understory {

std::unique_ptr<FrontEnd> make_front_end(const FrontEndConfig& config, const SensorTraits& traits,
                                         const RunConditions& conditions,
                                         const std::filesystem::path& work, Log& log) {
  if (const auto* sparse = std::get_if<SparseMappingConfig>(&config))
    return std::make_unique<SparseFrontEnd>(*sparse, conditions, work, log);
  return std::make_unique<DenseFrontEnd>(std::get<DenseMappingConfig>(config), traits, conditions,
                                         work, log);
}

}  // namespace understory
