#include <fmt/format.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <string>

#include "understory/simulation/sensors/counter_noise.h"
#include "understory/simulation/stand/stand_drawing.h"
#include "understory/simulation/stand/tree_cloud.h"
#include "understory/util/files/csv.h"

namespace understory {
namespace {

constexpr int kLargestId = 10'000'000;

// The list of trees; `fail` of a row names its line.
class TreeTable {
 public:
  explicit TreeTable(const std::string& path) : table_(path, {"x", "y", "dbh_m"}) {}

  [[nodiscard]] bool next() { return table_.next(); }
  [[nodiscard]] std::uint64_t line() const { return table_.lines().line_number(); }
  [[nodiscard]] std::string text(const std::string& name) const {
    return std::string(table_.text(name));
  }
  [[nodiscard]] bool has(const std::string& name) const { return !table_.text(name).empty(); }
  [[nodiscard]] double number(const std::string& name, double low, double high) const {
    const std::optional<double> value = to_number(table_.text(name));
    if (!value || !(*value >= low && *value <= high)) {
      fail(fmt::format("{} is \"{}\", expected a number in {}..{}", name, text(name), low, high));
    }
    return *value;
  }
  [[noreturn]] void fail(const std::string& what) const { table_.fail(what); }

 private:
  CsvReader table_;
};

Species species_of(const TreeTable& row, Species drawn) {
  const std::string name = row.text("species");
  if (name.empty()) return drawn;
  for (const Species species : {Species::kPine, Species::kSpruce, Species::kBirch}) {
    if (name == species_name(species)) return species;
  }
  row.fail("species is \"" + name + "\", expected pine, spruce or birch");
}

GrownTree read_tree(const std::string& list, const TreeTable& row, int number,
                    const StandConfig& config, const Terrain& terrain, Random& random) {
  GrownTree tree = draw_tree(config, random);
  tree.species = species_of(row, tree.species);
  const double x = row.number("x", -0.5 * config.size_x_m, 0.5 * config.size_x_m);
  const double y = row.number("y", -0.5 * config.size_y_m, 0.5 * config.size_y_m);
  tree.foot = {x, y, terrain.height(x, y)};
  if (row.has("dbh_m")) tree.dbh_m = row.number("dbh_m", 0.005, 5.0);
  tree.height_m = row.has("height_m")
                      ? row.number("height_m", 1.5, 120.0)
                      : std::max(config.height_min_m, height_of(tree.dbh_m, config));
  const double given_height_m = row.has("height_m") ? tree.height_m : 0.0;
  if (row.has("lean_deg")) {
    const double lean = std::tan(row.number("lean_deg", 0.0, 60.0) * std::numbers::pi / 180.0);
    const double way = random.uniform(0.0, 2.0 * std::numbers::pi);
    tree.lean = {lean * std::cos(way), lean * std::sin(way)};
    tree.sweep.setZero();
  }
  if (row.has("cloud")) {
    tree.cloud = (std::filesystem::path(list).parent_path() / row.text("cloud")).string();
    tree.sweep.setZero();
    tree.lean.setZero();
  }
  tree.id = row.has("id") ? static_cast<int>(row.number("id", 1, kLargestId)) : number;
  draw_crown(config, tree, random);
  if (!tree.cloud.empty()) tree.height_m = given_height_m;
  return tree;
}

// Trees of a cloud take its height, if the list gives none, and its lean.
void measure_clouds(std::vector<GrownTree>& trees) {
  std::map<std::string, TreeCloud> clouds;
  for (GrownTree& tree : trees) {
    if (tree.cloud.empty()) continue;
    auto found = clouds.find(tree.cloud);
    if (found == clouds.end())
      found = clouds.emplace(tree.cloud, read_tree_cloud(tree.cloud, tree.dbh_m)).first;
    if (tree.height_m <= 0.0) tree.height_m = found->second.height_m;
    tree.lean = Eigen::Rotation2Dd(tree.yaw_rad) * found->second.lean;
  }
}

}  // namespace

std::vector<std::string> tree_cloud_files(const std::string& list) {
  if (!std::filesystem::is_regular_file(list)) return {};
  std::set<std::string> files;
  CsvReader table(list);
  while (table.next()) {
    const std::string cloud(table.text("cloud"));
    if (!cloud.empty()) files.insert((std::filesystem::path(list).parent_path() / cloud).string());
  }
  return {files.begin(), files.end()};
}

std::vector<GrownTree> read_trees(const std::string& path, const StandConfig& config,
                                  const Terrain& terrain, std::uint64_t seed) {
  TreeTable row(path);
  std::vector<GrownTree> trees;
  std::set<int> ids;
  while (row.next()) {
    Random random(hash_numbers(seed, stream_of(NoiseStream::kStand), row.line()));
    trees.push_back(
        read_tree(path, row, static_cast<int>(trees.size()) + 1, config, terrain, random));
    if (!ids.insert(trees.back().id).second) {
      row.fail(fmt::format("id {} stands in the list twice", trees.back().id));
    }
  }
  measure_clouds(trees);
  return trees;
}

}  // namespace understory
