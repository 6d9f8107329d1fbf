#include "understory/evaluation/world_frame.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>

#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"
#include "understory/util/files/csv.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

constexpr const char* kNedName = "world_ned";
constexpr std::uintmax_t kMostBytes = 64U << 20;  // of a run.json, as RunJson has it
constexpr int kReaderDecimals = 9;                // of attitudes in files east, north, up
constexpr int kTurnedDecimals = 12;               // so that nine come back the same

// Axes of one quantity, by the names of their columns; empty: the table has none.
struct Columns {
  const char* x;
  const char* y;
  const char* z;
};
// Standard deviations turn without a sign. Biases of the IMU and covariances of poses are in the
// axes of the body, covariances of fixes in those of the receiver: neither turns.
constexpr std::array<Columns, 5> kTurnedColumns = {{{"x", "y", "z"},
                                                    {"x_to", "y_to", "z_to"},
                                                    {"vx", "vy", "vz"},
                                                    {"residual_x", "residual_y", "residual_z"},
                                                    {"x_sd_m", "y_sd_m", ""}}};

// The text of a number with the other sign. Zeros lose theirs.
std::string negated(std::string_view number) {
  const std::string_view text = trimmed(number);
  if (text.find_first_of("123456789") == std::string_view::npos && text.substr(0, 1) != "-")
    return std::string(number);
  if (!text.empty() && text.front() == '-') return std::string(text.substr(1));
  return "-" + std::string(text);
}

// The cells of a line of CSV as they stand there, with their quotes.
std::vector<std::string> raw_cells(const std::string& line) {
  std::vector<std::string> cells(1);
  bool quoted = false;
  for (const char c : line) {
    if (c == '"') quoted = !quoted;
    if (c == ',' && !quoted) {
      cells.emplace_back();
    } else {
      cells.back() += c;
    }
  }
  return cells;
}

std::string joined(const std::vector<std::string>& cells, char separator) {
  std::string line;
  for (const std::string& cell : cells) {
    if (&cell != &cells.front()) line += separator;
    line += cell;
  }
  return line;
}

// Turns `x y z qx qy qz qw` from cell `first` on; false where they are no numbers.
bool turn_pose(std::vector<std::string>& cells, std::size_t first, int decimals) {
  std::array<double, 7> v{};
  for (std::size_t i = 0; i < v.size(); ++i) {
    const std::optional<double> value = to_number(cells[first + i]);
    if (!value || !std::isfinite(*value)) return false;
    v[i] = *value;
  }
  std::swap(cells[first], cells[first + 1]);
  cells[first + 2] = negated(cells[first + 2]);
  // (0, s, s, 0) times the attitude: half a turn about the line between x and y.
  const double s = std::sqrt(0.5);
  const auto [qx, qy, qz, qw] = std::array{v[3], v[4], v[5], v[6]};
  std::array<double, 4> q = {s * (qw + qz), s * (qw - qz), s * (qy - qx), -s * (qx + qy)};
  if (q[3] < 0.0)
    for (double& value : q)
      value = -value;
  for (std::size_t i = 0; i < q.size(); ++i)
    cells[first + 3 + i] = csv_cell(q[i], decimals);
  return true;
}

// Turns the lines of one file, from its first on.
class LineTurn {
 public:
  LineTurn(const std::string& name, int decimals)
      : poses_(name.ends_with(".tum")), graph_(name.ends_with(".g2o")), decimals_(decimals) {}

  void operator()(std::string& line) {
    if (trimmed(line).empty() || line.front() == '#') return;
    if (poses_ || graph_) {
      turn_line_of_poses(line);
    } else if (pairs_) {
      turn_row(line);
    } else {
      read_header(line);
    }
  }

 private:
  void turn_line_of_poses(std::string& line) const {
    constexpr std::size_t kPose = 7;
    const std::vector<std::string_view> parts = split(line, " \t", true);
    const std::size_t first = graph_ ? 2 : 1;
    // Edges of a graph lead from body to body.
    if (parts.size() != first + kPose || (graph_ && parts[0] != "VERTEX_SE3:QUAT")) return;
    std::vector<std::string> cells(parts.begin(), parts.end());
    if (turn_pose(cells, first, decimals_)) line = joined(cells, ' ');
  }

  void read_header(const std::string& line) {
    const std::vector<std::string> names = raw_cells(line);
    const auto at = [&](const std::string& name) {
      const auto found = std::find(names.begin(), names.end(), name);
      return found == names.end() ? std::optional<std::size_t>()
                                  : static_cast<std::size_t>(found - names.begin());
    };
    pairs_.emplace();
    for (const Columns& columns : kTurnedColumns) {
      const auto x = at(columns.x);
      const auto y = at(columns.y);
      if (x && y) pairs_->emplace_back(*x, *y);
      if (const auto z = at(columns.z)) negated_.push_back(*z);
    }
    columns_ = names.size();
  }

  void turn_row(std::string& line) const {
    std::vector<std::string> cells = raw_cells(line);
    if (cells.size() != columns_) return;
    for (const auto& [x, y] : *pairs_)
      std::swap(cells[x], cells[y]);
    for (const std::size_t z : negated_)
      cells[z] = negated(cells[z]);
    line = joined(cells, ',');
  }

  bool poses_;
  bool graph_;
  int decimals_;
  // Of a table, after its header.
  std::optional<std::vector<std::pair<std::size_t, std::size_t>>> pairs_;
  std::vector<std::size_t> negated_;
  std::size_t columns_ = 0;
};

bool tells_of_ned(const std::string& text) {
  return text.find(kNedName) != std::string::npos ||
         text.find("\"world_frame\": \"ned\"") != std::string::npos;
}

}  // namespace

Eigen::Vector3d turned_axes(const Eigen::Vector3d& in_world) {
  return {in_world.y(), in_world.x(), -in_world.z()};
}

const std::vector<std::string>& world_files() {
  static const std::vector<std::string> names = {"trajectory.tum",
                                                 "odometry.tum",
                                                 "keyframes.tum",
                                                 "trajectory_imu.tum",
                                                 "trajectory_partial.tum",
                                                 "states.csv.gz",
                                                 "graph.g2o",
                                                 "gnss.csv",
                                                 "trees.csv",
                                                 "stem_curves.csv",
                                                 "dead_wood.csv",
                                                 "felled.csv",
                                                 "cuts.csv",
                                                 "plots.csv"};
  return names;
}

std::string frame_name(WorldFrame frame) {
  return frame == WorldFrame::kNed ? kNedName : "world";
}

void turn_to_ned(const fs::path& folder) {
  for (const std::string& name : world_files()) {
    if (!fs::exists(folder / name)) continue;
    LineReader lines(folder / name, LineTurn(name, kTurnedDecimals));
    AtomicTextFile file(folder / name);
    std::string line;
    while (lines.next(line))
      file.write(line + "\n");
    file.commit();
  }
}

WorldFrame world_frame_of(const fs::path& file) {
  const fs::path run = fs::absolute(file).parent_path() / "run.json";
  std::error_code error;
  if (!fs::is_regular_file(run, error) || fs::file_size(run, error) > kMostBytes || error)
    return WorldFrame::kEnu;
  std::ifstream stream(run);
  std::ostringstream content;
  content << stream.rdbuf();
  const std::string text = content.str();
  if (!tells_of_ned(text)) return WorldFrame::kEnu;  // the most of them, which need no parsing
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  if (json.is_discarded())
    throw InputError(run.string(), "",
                     "expected an undamaged run.json: this one does not say whether " +
                         file.filename().string() +
                         " is in north, east, down or in east, north, up");
  const auto frames = json.is_object() ? json.find("frames") : json.end();
  if (frames == json.end() || !frames->is_object()) return WorldFrame::kEnu;
  const auto frame = frames->find(file.filename().string());
  const bool ned = frame != frames->end() && frame->is_string() && *frame == kNedName;
  return ned ? WorldFrame::kNed : WorldFrame::kEnu;
}

WorldFrame world_frame_of_run(const fs::path& folder) {
  return world_frame_of(folder / "trajectory.tum");
}

std::function<void(std::string&)> turned_back(const fs::path& file) {
  if (world_frame_of(file) == WorldFrame::kEnu) return {};
  return LineTurn(file.filename().string(), kReaderDecimals);
}

}  // namespace understory
