#include "understory/simulation/carrier/followers.h"

#include <Eigen/Core>
#include <cmath>

#include "understory/simulation/sensors/counter_noise.h"
#include "understory/simulation/stand/objects.h"
#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kAbreast = 0.35;  // metres from the middle of a pair to each of them
constexpr double kNextPair = 0.8;  // metres from one pair to the next

// The track of one who is led at `behind` metres in the plane, `aside` metres to the left.
std::vector<Eigen::Vector3d> track_behind(const CarrierPath& path, const Terrain& terrain,
                                          double behind_m, double aside_m, double step_s) {
  std::vector<Eigen::Vector3d> track;
  const Pose first = path.pose(0.0);
  const Eigen::Vector2d ahead = (first.rotation_matrix().col(0)).head<2>().normalized();
  Eigen::Vector2d led = first.translation().head<2>() - behind_m * ahead;
  for (double time = 0.0; time <= path.duration_s(); time += step_s) {
    const Eigen::Vector2d body = path.pose(time).translation().head<2>();
    const Eigen::Vector2d along = (body - led).normalized();
    led = body - behind_m * along;
    const Eigen::Vector2d foot = led + aside_m * Eigen::Vector2d(-along.y(), along.x());
    track.emplace_back(foot.x(), foot.y(), terrain.smooth_height(foot.x(), foot.y(), 0.3));
  }
  return track;
}

}  // namespace

const Stand& with_followers(const ObjectsConfig& config, const CarrierPath& path,
                            const Terrain& terrain, std::uint64_t seed, Stand& stand) {
  Random random(hash_numbers(seed, stream_of(NoiseStream::kFollowers)));
  for (int i = 0; i < config.followers; ++i) {
    StandObject person;
    person.kind = ObjectKind::kFollower;
    shape_person(person, random);
    person.track = track_behind(path, terrain, config.follow_m + kNextPair * (i / 2),
                                i % 2 == 0 ? kAbreast : -kAbreast, person.track_step_s);
    person.foot = person.track.front();
    stand.objects.push_back(person);
  }
  return stand;
}

}  // namespace understory
