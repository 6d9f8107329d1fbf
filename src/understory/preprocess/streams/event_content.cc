#include "understory/preprocess/streams/event_content.h"

#include <bit>
#include <initializer_list>

#include "understory/sensor/scan_content.h"

namespace understory {
namespace {

std::uint64_t mixed(std::initializer_list<double> numbers) {
  constexpr std::uint64_t kFactor = 0x9E3779B97F4A7C15U;
  std::uint64_t sum = numbers.size();
  for (const double number : numbers) {
    sum = (sum ^ std::bit_cast<std::uint64_t>(number)) * kFactor;
    sum ^= sum >> 32U;
  }
  return sum;
}

struct Content {
  std::uint64_t operator()(const ScanPtr& scan) const { return content_of(*scan); }
  std::uint64_t operator()(const ImuSample& sample) const {
    const Eigen::Vector3d& rate = sample.angular_rate;
    const Eigen::Vector3d& force = sample.specific_force;
    return mixed({rate.x(), rate.y(), rate.z(), force.x(), force.y(), force.z()});
  }
  std::uint64_t operator()(const GnssFix& fix) const {
    return mixed({fix.latitude_deg, fix.longitude_deg, fix.height_m});
  }
  std::uint64_t operator()(const MagSample& sample) const {
    return mixed({sample.field.x(), sample.field.y(), sample.field.z()});
  }
};

}  // namespace

std::uint64_t content_of(const Event& event) {
  return std::visit(Content(), event);
}

}  // namespace understory
