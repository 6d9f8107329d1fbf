// Stems of single frames against the truth of the simulator (docs/method/sparse.md): recall over
// range, and precision. Also errors of the centre, the foot and the radius, and the time of a
// frame.
//   stem_frames SITE SEED [EVERY] [key=value ...] [--traits FILE] [--repeats N]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "understory/features/test_frames.h"
#include "understory/util/parallel.h"
#include "understory/util/timing.h"

namespace understory {
namespace {

struct Options {
  std::string site;
  std::vector<std::string> settings;
  int every = 300;  // of the sensor's revolutions each so-manieth
  int repeats = 1;
  std::FILE* traits = nullptr;
};

Options parse(int argc, char** argv) {
  Options options;
  options.site = argv[1];
  options.settings = {std::string("seed=") + argv[2]};
  for (int i = 3; i < argc; ++i) {
    const std::string text = argv[i];
    if (text == "--traits" && i + 1 < argc) {
      options.traits = std::fopen(argv[++i], "w");
    } else if (text == "--repeats" && i + 1 < argc) {
      options.repeats = std::max(1, std::atoi(argv[++i]));
    } else if (text.find('=') != std::string::npos) {
      options.settings.push_back(text);
    } else {
      options.every = std::max(1, std::atoi(argv[i]));
    }
  }
  return options;
}

void print_row(const std::string& name, const StemBand& band) {
  const auto percent = [](int part, int all) { return all > 0 ? 100.0 * part / all : 0.0; };
  const double right = std::max(1, band.right);
  const double feet = std::max(1, band.feet);
  std::printf("%-6s %6d %7.1f %6d %7.1f %9d %7.1f %9.1f %7.1f %7.1f %9.1f %7.1f %9.1f %7.1f\n",
              name.c_str(), band.seen, percent(band.seen_found, band.seen), band.clear,
              percent(band.clear_found, band.clear), band.segments,
              percent(band.right, band.segments), 100.0 * band.centre_rmse_m(),
              100.0 * band.along / right, 100.0 * std::sqrt(band.foot_squares / feet),
              100.0 * std::sqrt(band.foot_height_squares / feet), 100.0 * band.foot_height / feet,
              100.0 * std::sqrt(band.radius_squares / right), 100.0 * band.radius / right);
}

void print(const std::vector<StemBand>& bands) {
  std::printf(
      "range       seen found%%   clear found%%  segments  right%%  centre   along    foot   "
      "height    bias    radius    bias (cm)\n");
  StemBand near;
  for (std::size_t i = 0; i < bands.size(); ++i) {
    print_row(std::to_string(5 * i) + "-" + std::to_string(5 * i + 5), bands[i]);
    if (i < 3) near += bands[i];
  }
  print_row("0-15", near);
}

void run(const Options& options) {
  TestFrames site(load_site(options.site, options.settings));
  StemSegmentConfig config;
  if (options.traits != nullptr) config.min_score = 0.0;
  std::vector<StemBand> bands(9);
  double seconds = 0.0;
  double segments = 0.0;
  int frames = 0;
  for (std::int64_t k = 0; to_seconds(site.scanner.end(k)) < site.duration_s();
       k += options.every) {
    const SimulatedScan frame = site.scanner.cast(k);
    StemSegments found;
    const double start = process_cpu_seconds();
    for (int i = 0; i < options.repeats; ++i)
      found = find_stem_segments(*frame.scan, config);
    seconds += (process_cpu_seconds() - start) / options.repeats;
    segments += static_cast<double>(found.stems.size());
    ++frames;
    config.up = found.up;  // as a run does
    compare_stems(site, frame, found, bands, options.traits);
  }
  print(bands);
  std::printf("%d frames, %.1f segments a frame, %.2f ms of processor time a frame\n", frames,
              segments / frames, 1e3 * seconds / frames);
}

}  // namespace
}  // namespace understory

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: stem_frames SITE SEED [EVERY] [key=value ...]\n");
    return 2;
  }
  const understory::Options options = understory::parse(argc, argv);
  understory::with_threads(1, [&] { understory::run(options); });
  if (options.traits != nullptr) std::fclose(options.traits);
  return 0;
}
