#include "understory/recording/captures/hesai/hesai_calibration.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <optional>
#include <sstream>
#include <string_view>

#include "understory/util/error.h"
#include "understory/util/files/csv.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

constexpr std::size_t kMostChannels = 256;
constexpr std::uint64_t kLargestFile = 1 << 20;

enum class FileKind { kOther, kAngles, kFiringTimes };

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

FileKind kind_of(const std::string& first_line) {
  const std::string line = lower(first_line);
  const auto has = [&](std::string_view word) { return line.find(word) != std::string::npos; };
  if (has("elevation") && has("azimuth")) return FileKind::kAngles;
  return has("channel") && has("fire") ? FileKind::kFiringTimes : FileKind::kOther;
}

// Rows of numbers behind the header, by channel: channel i + 1 is row i.
std::vector<std::vector<double>> read_table(const std::string& path, FileKind kind,
                                            std::size_t columns, const std::string& expected) {
  std::istringstream stream(read_text_file(path, kLargestFile));
  std::string line;
  std::getline(stream, line);
  if (kind_of(line) != kind) throw InputError(path, "line 1", expected);
  std::vector<std::vector<double>> rows;
  std::size_t known = 0;
  for (std::size_t at = 2; std::getline(stream, line); ++at) {
    if (trimmed(line).empty()) continue;
    const std::string place = "line " + std::to_string(at);
    std::vector<double> values;
    for (const std::string_view cell : split(line, ",", false)) {
      const std::optional<double> value = to_number(cell);
      if (!value || !std::isfinite(*value) || values.size() == columns) break;
      values.push_back(*value);
    }
    if (values.size() != columns) throw InputError(path, place, expected);
    const double channel = values[0];
    if (channel < 1.0 || channel > static_cast<double>(kMostChannels) ||
        channel != std::floor(channel))
      throw InputError(path, place, "expected a channel of 1 to 256");
    const auto index = static_cast<std::size_t>(channel) - 1;
    if (rows.size() <= index) rows.resize(index + 1);
    if (!rows[index].empty())
      throw InputError(path, place, "channel " + std::to_string(index + 1) + " stands there twice");
    rows[index] = values;
    ++known;
  }
  if (known == 0 || known != rows.size())
    throw InputError(path, "",
                     "expected a line for each channel from 1 on; there are " +
                         std::to_string(known) + " up to channel " + std::to_string(rows.size()));
  return rows;
}

FileKind kind_of_file(const std::string& path) {
  try {
    const std::string text = read_text_file(path, kLargestFile);
    return kind_of(text.substr(0, text.find('\n')));
  } catch (const InputError&) {
    return FileKind::kOther;
  }
}

// The only file of a kind beside the recording; empty if there is none.
std::string only_file(const std::vector<std::string>& beside, FileKind kind,
                      const std::string& recording) {
  std::string found;
  for (const std::string& path : beside) {
    if (kind_of_file(path) != kind) continue;
    if (!found.empty())
      throw InputError(recording, "",
                       "several calibration files could belong to it (" + found + ", " + path +
                           "): keep one beside it, or name the angle file with --metadata");
    found = path;
  }
  return found;
}

std::vector<std::string> csv_files_beside(const std::string& recording) {
  namespace fs = std::filesystem;
  fs::path path(recording);
  if (!path.has_filename()) path = path.parent_path();
  const std::string stem = path.stem().string();
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  std::vector<std::string> found;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() != ".csv") continue;
    const std::string name = entry.path().stem().string();
    const bool alike = !name.empty() && (stem.rfind(name, 0) == 0 || name.rfind(stem, 0) == 0);
    if (alike) found.push_back(entry.path().string());
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace

void read_hesai_angles(const std::string& path, HesaiCalibration& calibration) {
  const auto rows = read_table(path, FileKind::kAngles, 3,
                               "expected a Hesai angle correction file: Channel,Elevation,Azimuth");
  calibration.angles_file = path;
  calibration.elevation_deg.clear();
  calibration.azimuth_deg.clear();
  for (const std::vector<double>& row : rows) {
    if (std::abs(row[1]) > 90.0 || std::abs(row[2]) > 360.0)
      throw InputError(path, "", "expected elevations up to 90 and azimuths up to 360 degrees");
    calibration.elevation_deg.push_back(row[1]);
    calibration.azimuth_deg.push_back(row[2]);
  }
}

void read_hesai_firing_times(const std::string& path, HesaiCalibration& calibration) {
  const auto rows = read_table(path, FileKind::kFiringTimes, 2,
                               "expected a Hesai firing time file: Channel,fire time(us)");
  calibration.firing_file = path;
  calibration.firing_us.clear();
  for (const std::vector<double>& row : rows) {
    if (std::abs(row[1]) > 1000.0)
      throw InputError(path, "", "expected firing times up to 1000 microseconds");
    calibration.firing_us.push_back(row[1]);
  }
}

HesaiCalibration find_hesai_calibration(const std::string& recording, const std::string& named) {
  HesaiCalibration calibration;
  const std::vector<std::string> beside = csv_files_beside(recording);
  const std::string angles =
      named.empty() ? only_file(beside, FileKind::kAngles, recording) : named;
  if (!angles.empty()) read_hesai_angles(angles, calibration);
  const std::string firings = only_file(beside, FileKind::kFiringTimes, recording);
  if (!firings.empty()) read_hesai_firing_times(firings, calibration);
  return calibration;
}

}  // namespace understory
