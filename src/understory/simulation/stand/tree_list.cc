#include <fmt/format.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <set>
#include <string>

#include "understory/simulation/sensors/counter_noise.h"
#include "understory/simulation/stand/stand_drawing.h"
#include "understory/simulation/stand/tree_cloud.h"
#include "understory/util/error.h"
#include "understory/util/text_file.h"

namespace understory {
namespace {

constexpr int kLargestId = 10'000'000;

std::vector<std::string> fields_of(std::string line) {
  while (!line.empty() && (line.back() == '\r' || line.back() == ' '))
    line.pop_back();
  std::vector<std::string> fields(1);
  for (const char c : line) {
    if (c == ',') {
      fields.emplace_back();
    } else if (c != '"') {
      fields.back() += c;
    }
  }
  return fields;
}

// One line of the list, by the names of its columns.
class Row {
 public:
  Row(const std::string& path, std::size_t line, const std::map<std::string, std::size_t>& columns,
      std::vector<std::string> fields)
      : path_(path), line_(line), columns_(columns), fields_(std::move(fields)) {}

  [[nodiscard]] std::string text(const std::string& name) const {
    const auto found = columns_.find(name);
    return found == columns_.end() || found->second >= fields_.size() ? "" : fields_[found->second];
  }
  [[nodiscard]] bool has(const std::string& name) const { return !text(name).empty(); }

  [[nodiscard]] double number(const std::string& name, double low, double high) const {
    const std::string value = text(name);
    double parsed = 0.0;
    const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), parsed);
    const bool whole = error == std::errc() && end == value.data() + value.size();
    if (!whole || !(parsed >= low && parsed <= high)) {
      fail(fmt::format("{} is \"{}\", expected a number in {}..{}", name, value, low, high));
    }
    return parsed;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(path_, fmt::format("line {}", line_), what);
  }

 private:
  const std::string& path_;
  std::size_t line_;
  const std::map<std::string, std::size_t>& columns_;
  std::vector<std::string> fields_;
};

Species species_of(const Row& row, Species drawn) {
  const std::string name = row.text("species");
  if (name.empty()) return drawn;
  for (const Species species : {Species::kPine, Species::kSpruce, Species::kBirch}) {
    if (name == species_name(species)) return species;
  }
  row.fail("species is \"" + name + "\", expected pine, spruce or birch");
}

GrownTree read_tree(const std::string& list, const Row& row, int number, const StandConfig& config,
                    const Terrain& terrain, Random& random) {
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
  std::ifstream file(list);
  std::string line;
  std::set<std::string> files;
  if (!read_line(file, line, list, 1)) return {};
  const std::vector<std::string> names = fields_of(line);
  const auto column = static_cast<std::size_t>(
      std::distance(names.begin(), std::find(names.begin(), names.end(), "cloud")));
  for (std::uint64_t number = 2; read_line(file, line, list, number); ++number) {
    const std::vector<std::string> fields = fields_of(line);
    if (column < fields.size() && !fields[column].empty()) {
      files.insert((std::filesystem::path(list).parent_path() / fields[column]).string());
    }
  }
  return {files.begin(), files.end()};
}

std::vector<GrownTree> read_trees(const std::string& path, const StandConfig& config,
                                  const Terrain& terrain, std::uint64_t seed) {
  std::ifstream file(path);
  std::string line;
  if (!file) throw InputError(path, "", "the list of trees cannot be opened");
  if (!read_line(file, line, path, 1)) {
    throw InputError(path, "", "expected a list of trees: a CSV with the columns x, y, dbh_m");
  }
  std::map<std::string, std::size_t> columns;
  const std::vector<std::string> names = fields_of(line);
  for (std::size_t i = 0; i < names.size(); ++i)
    columns.emplace(names[i], i);
  for (const char* needed : {"x", "y", "dbh_m"}) {
    if (!columns.count(needed)) {
      throw InputError(path, "line 1",
                       fmt::format("no column {}, expected at least x, y, dbh_m", needed));
    }
  }
  std::vector<GrownTree> trees;
  std::set<int> ids;
  for (std::size_t number = 2; read_line(file, line, path, number); ++number) {
    std::vector<std::string> fields = fields_of(line);
    if (fields.size() == 1 && fields[0].empty()) continue;
    const std::size_t held = fields.size();
    const Row row(path, number, columns, std::move(fields));
    if (held < names.size())
      row.fail(fmt::format("holds {} of {} columns: is the list cut off?", held, names.size()));
    Random random(hash_numbers(seed, stream_of(NoiseStream::kStand), number));
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
