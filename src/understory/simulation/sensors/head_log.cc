#include "understory/simulation/sensors/head_log.h"

#include "understory/simulation/sensors/counter_noise.h"
#include "understory/util/random.h"

namespace understory {

std::vector<HeadCutSample> log_head_cuts(const SimulatedWorld& world, TimeNs start,
                                         double until_s) {
  const HeadLogConfig& config = world.site.head_log;
  Random random(static_cast<std::uint64_t>(world.site.seed), stream_of(NoiseStream::kHeadLog));
  const auto error = [&](double sd) {
    const double x = random.normal(0.0, sd);
    const double y = random.normal(0.0, sd);
    return Eigen::Vector3d(x, y, random.normal(0.0, sd));
  };
  const Eigen::Vector3d bias = error(config.bias_sd_m);
  std::vector<HeadCutSample> cuts;
  for (const Felling& felling : world.plan.harvest.fellings) {
    const bool noted = !random.chance(config.missed);
    const Eigen::Vector3d off = bias + error(config.sd_m);
    if (!noted || felling.grab_s >= until_s) continue;
    cuts.push_back({start + from_seconds(felling.grab_s),
                    head_in_body(world.plan.boom.value(felling.grab_s)) + off});
  }
  return cuts;
}

}  // namespace understory
