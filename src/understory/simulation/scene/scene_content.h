#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "understory/simulation/scene/crown_shapes.h"
#include "understory/simulation/scene/embree.h"
#include "understory/simulation/scene/scene.h"
#include "understory/simulation/scene/scene_bundles.h"
#include "understory/simulation/scene/stem_surface.h"
#include "understory/simulation/stand/harvest.h"
#include "understory/simulation/stand/wind.h"

namespace understory {

// One thread builds, so that the tree of boxes does not depend on how many there are.
void commit_alone(RTCScene scene);

// What a ForestScene holds: a fixed scene of ground, stems and dead wood, and a scene of instances.
// Those are crowns, plants, and stems that sway or fall. Built once; owns all of it.
class SceneContent {
 public:
  SceneContent(const StandConfig& config, const Terrain& terrain, const Stand& stand,
               std::uint64_t seed, double snow_m, const Harvest& harvest, Casting casting);
  ~SceneContent();
  SceneContent(const SceneContent&) = delete;
  SceneContent& operator=(const SceneContent&) = delete;

 protected:
  static constexpr double kForever = 1e12;  // seconds
  static constexpr unsigned kGroundGeometry = 0;
  static constexpr unsigned kStemGeometry = 1;
  static constexpr unsigned kWoodGeometry = 2;
  static constexpr unsigned kBoulderGeometry = 3;
  static constexpr unsigned kBuildingGeometry = 4;

  // What an instance is: its surface, how it is turned, and how bright.
  struct Instance {
    Surface surface;
    float cos_yaw;
    float sin_yaw;
    float reflectivity;
    int tree = 0;                  // whose stem or crown this is
    std::size_t sway = kStands;    // in sways_
    std::size_t walker = kStands;  // in walkers_
  };
  static constexpr std::size_t kStands = ~std::size_t{0};

  static constexpr unsigned kNone = ~0U;

  // A part of a tree that leans with the wind.
  struct Swaying {
    unsigned instance;
    std::size_t tree;  // in sways_
  };
  struct TreeSway {
    Wind::Sway sway;
    double stiff_m;  // height above the foot from which it yields
    double height_m;
    float foot_z;
    Eigen::Vector2f bend = Eigen::Vector2f::Zero();       // now, metres a metre of height
    Eigen::Vector2f bend_rate = Eigen::Vector2f::Zero();  // 1/s
  };
  // A thing that walks, and its parts.
  struct Walker {
    StandObject object;
    std::vector<unsigned> instances;
    Eigen::Vector2f velocity = Eigen::Vector2f::Zero();  // now
  };
  // A part that is there for a time only.
  struct Timed {
    unsigned instance;
    double from_s;
    double until_s;
  };
  struct FelledTree {
    double grab_s = 0.0;
    Eigen::Vector3f foot = Eigen::Vector3f::Zero();
    float reach_m = 0.0F;  // farthest that a part of it stands off its foot's vertical
    unsigned stem = kNone;
    unsigned living = kNone;
    unsigned dead = kNone;
  };

  std::unique_ptr<SceneBundles> bundles_;  // the same once more, where beams are cast whole
  RTCDevice device_ = nullptr;
  RTCScene static_ = nullptr;  // ground, stems as far as they never move, dead wood
  RTCScene rooted_ = nullptr;  // instances that never move: plants
  RTCScene top_ = nullptr;     // all other instances; numbers of instances hold for both
  std::vector<RTCScene> scenes_;
  RTCScene still_ = nullptr;  // all instances at rest, before the harvest
  std::vector<Instance> instances_;
  std::vector<std::pair<RTCScene, Eigen::Matrix<float, 3, 4>>> shapes_;  // of the instances
  std::vector<bool> present_;                                            // of the instances
  std::vector<Swaying> swaying_;
  std::vector<TreeSway> sways_;
  std::vector<Walker> walkers_;
  std::vector<Timed> timed_;
  std::vector<double> changes_;
  std::map<int, FelledTree> felled_;  // by id
  bool snowy_ = false;
  double snow_m_ = 0.0;
  Wind wind_;
  std::vector<int> cone_tree_;  // id of the tree of each cone
  std::vector<float> bark_;     // reflectivity by id
  // What is not round of each stem, by id, and its foot's height.
  std::vector<StemSurface> surfaces_;
  std::vector<float> foot_z_;

 private:
  // A crown that trees are instances of.
  struct CrownScene {
    RTCScene living;
    RTCScene dead;
  };
  void add_static(const Terrain& terrain, const Stand& stand);
  void add_bark(const StandConfig& config, const Stand& stand, std::uint64_t seed);
  void add_solids(const Stand& stand);
  void add_shapes(GrownShapes& grown);
  // What of a tree is not part of the fixed scene: its crown, and of its stem what sways or falls.
  void add_tree(const GrownTree& tree, const std::vector<GrownCrown>& grown);
  // A scanned tree: four instances, of stem and crown below and above where it yields.
  void add_cloud(const GrownTree& tree, std::size_t sway);
  // The stem's upper part, which sways, or all of it where it will be felled; the feet of those
  // stand still.
  unsigned add_stem(const GrownTree& tree, bool all, std::size_t sway);
  // The grown shape, stretched to the tree's height and crown, turned and sheared with its lean.
  std::pair<unsigned, unsigned> add_crown(const GrownTree& tree, const CrownScene& crown,
                                          const CrownSize& size, std::size_t sway);
  // Stumps, logs and branches that the harvest leaves.
  void add_remains(const Harvest& harvest, const Stand& stand);
  void add_wood(const Wood& wood, double from_s);
  void time_limit(unsigned instance, double from_s, double until_s);
  void add_plants(const Stand& stand);
  // Things that are no trees: those that stand, and those that walk.
  void add_things(const Stand& stand);
  [[nodiscard]] RTCScene plant_scene(PlantKind kind, std::size_t variant) const;
  unsigned add_plant(RTCScene where, const Plant& plant, RTCScene scene, double sunk_m);
  RTCScene new_scene();
  // A scene of one geometry that instances can be made of, and its counterpart for bundles.
  template <class Content>
  RTCScene scene_of(RTCGeometry geometry, const Content& content);
  template <class Content>
  void add_fixed(unsigned number, RTCGeometry geometry, const Content& content);
  RTCScene shape_scene(Shape shape);
  unsigned add_instance(RTCScene where, RTCScene scene,
                        const Eigen::Matrix<float, 3, 4>& world_from_shape,
                        const Instance& instance);
  // The same crowns and plants once more, to stay where they are.
  RTCScene copy_of_instances();

  std::vector<CrownScene> crowns_;
  std::vector<RTCScene> plants_;  // three of each kind
  // A scanned tree, cut where it yields to the wind.
  struct CloudScenes {
    RTCScene stem[2];  // below and above, nullptr if there is nothing
    RTCScene crown[2];
    double height_m;
  };
  std::map<std::string, CloudScenes> clouds_;  // by file
};

}  // namespace understory
