#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "understory/cli/command.h"
#include "understory/cli/convert_layers.h"
#include "understory/cli/convert_stems.h"
#include "understory/cli/open_options.h"
#include "understory/cli/suggestion.h"
#include "understory/output/clouds/las_writer.h"
#include "understory/pipeline/source.h"
#include "understory/recording/bags/mcap_writer.h"
#include "understory/recording/clouds/cloud_folder_writer.h"
#include "understory/recording/messages/arrival_times.h"
#include "understory/util/error.h"
#include "understory/util/files/output_guard.h"
#include "understory/util/files/staged_output.h"

namespace understory {
namespace {

struct ConvertOptions {
  std::string input;
  std::string output;
  OpenOptions open;
  std::string format;
  std::string compression = "zstd";
  bool overwrite = false;
  LayerConversion layers;
};

// What a recording is written to; it appears with `commit`.
class Target {
 public:
  virtual ~Target() = default;
  virtual void set_rig(const Rig& rig) = 0;
  // `arrival`: when it was recorded, where that is known.
  virtual void write(const Event& event, std::optional<TimeNs> arrival) = 0;
  virtual void finish() = 0;
  virtual void commit() = 0;
  [[nodiscard]] virtual bool replaces() const = 0;
};

// `Staged` tells the writer where to write.
template <typename Writer, typename Staged>
class TargetOf : public Target {
 public:
  template <typename... Arguments>
  explicit TargetOf(std::unique_ptr<Staged> staged, Arguments&&... arguments)
      : staged_(std::move(staged)),
        writer_(staged_->part().string(), std::forward<Arguments>(arguments)...) {}
  void set_rig(const Rig& rig) override { writer_.set_rig(rig); }
  void write(const Event& event, std::optional<TimeNs> arrival) override {
    if constexpr (requires { writer_.write(event, *arrival); }) {
      if (arrival) return writer_.write(event, *arrival);
    }
    writer_.write(event);
  }
  void finish() override { writer_.finish(); }
  void commit() override { staged_->commit(); }
  [[nodiscard]] bool replaces() const override { return staged_->replaces(); }

 private:
  std::unique_ptr<Staged> staged_;
  Writer writer_;  // is let go of first
};

// Each return's own time goes into the GPS time.
void write_las_cloud(const std::string& path, const Scan& scan) {
  LasWriter writer(path, {});
  for (const ScanPoint& point : scan.points) {
    LasRecord out;
    out.x = point.x;
    out.y = point.y;
    out.z = point.z;
    out.stamp = scan.stamp + static_cast<TimeNs>(point.t_ns);
    out.intensity =
        static_cast<std::uint16_t>(std::lround(std::clamp(point.intensity, 0.0F, 65535.0F)));
    writer.add(out);
  }
  writer.commit();
}

std::unique_ptr<Target> make_target(const ConvertOptions& options) {
  if (std::filesystem::path(options.output).extension() == ".mcap") {
    McapWriterOptions mcap;
    mcap.compression = options.compression == "zstd"  ? McapCompression::kZstd
                       : options.compression == "lz4" ? McapCompression::kLz4
                                                      : McapCompression::kNone;
    return std::make_unique<TargetOf<McapWriter, StagedFile>>(
        std::make_unique<StagedFile>(options.output, options.overwrite), mcap);
  }
  const std::string ending = "." + (options.format.empty() ? "pcd" : options.format);
  CloudWriter writer = cloud_writer(ending);
  if (!writer) writer = write_las_cloud;
  return std::make_unique<TargetOf<CloudFolderWriter, StagedFolder>>(
      std::make_unique<StagedFolder>(options.output), ending, std::move(writer));
}

// A folder of clouds by the name of a file is a slip: "stems.csv" for "stems.csv.gz".
void refuse_other_files(const ConvertOptions& options) {
  constexpr std::array<const char*, 10> kFiles = {".csv", ".gz",  ".bag", ".db3", ".pcap",
                                                  ".las", ".laz", ".ply", ".pcd", ".bin"};
  const std::string ending = std::filesystem::path(options.output).extension().string();
  if (std::find(kFiles.begin(), kFiles.end(), ending) != kFiles.end())
    throw ConfigError({options.output +
                       ": expected a name that ends in .mcap or .csv.gz, or that of a folder "
                       "(its clouds by --format)"});
}

// Hands a recording on to its target. The rig is known once the first scan has come, so what comes
// before it waits.
class Copier {
 public:
  Copier(Recording& recording, Target& target)
      : recording_(recording),
        arrivals_(dynamic_cast<const ArrivalTimes*>(&recording)),
        target_(target) {}

  // The next event; false at the end.
  bool copy_next() {
    auto event = recording_.next();
    if (!event) return false;
    ++events_;
    const bool is_scan = std::holds_alternative<ScanPtr>(*event);
    scans_ += is_scan ? 1 : 0;
    waiting_.push_back(
        {std::move(*event), arrivals_ == nullptr ? std::nullopt : arrivals_->arrival()});
    if (begun_ || is_scan || waiting_.size() >= kMostWaiting) pass_on();
    return true;
  }
  void finish() {
    pass_on();
    target_.finish();
  }
  [[nodiscard]] std::uint64_t events() const { return events_; }
  [[nodiscard]] std::uint64_t scans() const { return scans_; }

 private:
  static constexpr std::size_t kMostWaiting = 100'000;
  struct Waiting {
    Event event;
    std::optional<TimeNs> arrival;
  };

  void pass_on() {
    tell_rig();
    for (const Waiting& each : waiting_)
      target_.write(each.event, each.arrival);
    waiting_.clear();
  }
  // At the beginning, and where the place of a sensor becomes known later.
  void tell_rig() {
    const Rig& rig = recording_.rig();
    const bool has_imu = rig.body_from_imu.has_value();
    const int antennas = static_cast<int>(rig.body_from_gnss.has_value()) +
                         static_cast<int>(rig.body_from_second_gnss.has_value());
    if (begun_ && has_imu == has_imu_ && antennas == antennas_) return;
    target_.set_rig(rig);
    begun_ = true;
    has_imu_ = has_imu;
    antennas_ = antennas;
  }

  Recording& recording_;
  const ArrivalTimes* arrivals_;  // null where the format does not tell them
  Target& target_;
  std::vector<Waiting> waiting_;
  bool begun_ = false;
  bool has_imu_ = false;
  int antennas_ = 0;  // whose place is known
  std::uint64_t events_ = 0;
  std::uint64_t scans_ = 0;
};

int run_convert(const ConvertOptions& options, CommandContext& context) {
  const bool to_database = !options.layers.target.empty();
  if (to_database && !options.output.empty()) throw ConfigError({"expected OUT or --to, not both"});
  if (!to_database && options.output.empty()) throw ConfigError({"expected OUT, or --to PG:..."});
  if (options.layers.layer != LayerConversion().layer && !is_layer_output(options.output))
    throw ConfigError({"--layer names the layer of a .geojson; expected such an OUT"});
  if (to_database || is_layer_output(options.output)) {
    LayerConversion conversion = options.layers;
    conversion.input = options.input;
    conversion.output = options.output;
    conversion.overwrite = options.overwrite;
    return convert_layers(conversion, context);
  }
  refuse_run(options.input);
  refuse_stems(options.input);
  refuse_input_as_output(options.output, files_of(options.input, options.open));
  if (is_stems_file(options.output))
    return convert_to_stems(options.input, options.output, options.open, options.overwrite,
                            context);
  refuse_other_files(options);
  // Before the work on what it is to hold: a place that cannot be written is told at once.
  const std::unique_ptr<Target> target = make_target(options);
  const std::unique_ptr<Recording> recording =
      open_source(options.input, options.open, context.log);
  Copier copier(*recording, *target);
  bool stopped = false;
  while (!stopped && copier.copy_next()) {
    if (copier.events() % 64 != 0) continue;
    context.progress({"converting", 100.0 * recording->progress(), 100.0, "%",
                      std::to_string(copier.scans()) + " scans"});
    stopped = context.stop_requested();
  }
  if (copier.events() == 0)
    throw InputError(options.input, "", "expected scans, IMU samples or fixes; found none");
  copier.finish();
  return commit_conversion(*target, stopped, options.output, context);
}

void add_layer_options(CLI::App& command, LayerConversion& layers) {
  command.add_option("--to", layers.target,
                     "All layers of trees.gpkg into a PostGIS database: PG:host=... dbname=...");
  command.add_option("--layer", layers.layer, "Layer of trees.gpkg that a .geojson holds")
      ->capture_default_str();
  command.add_option("--schema", layers.schema, "Schema of the database")->capture_default_str();
  command.add_option("--run-id", layers.run_id,
                     "Rows of the same run are replaced (default: by the hashes of its input)");
}

}  // namespace

void add_convert_command(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<ConvertOptions>();
  CLI::App* command =
      app.add_subcommand("convert",
                         "Write a recording in another format, or the trees of a run as GeoJSON "
                         "or into PostGIS");
  command
      ->add_option("IN", options->input,
                   "Recording: file or folder, or sim:SITE?key=value; or a run folder")
      ->required();
  command->add_option(
      "OUT", options->output,
      "x.mcap: a recording; x.csv.gz: the stems seen in it, or in a cloud. x.geojson: "
      "the trees of a run, or another layer (--layer). Else a folder of clouds");
  command->add_flag("--overwrite", options->overwrite, "Replace a file OUT that is there already");
  command->add_option("--format", options->format, "Clouds of a folder (default pcd)")
      ->check(CLI::IsMember({"pcd", "ply", "las", "laz", "bin"}));
  command->add_option("--compression", options->compression, "Chunks of an MCAP file")
      ->check(CLI::IsMember({"none", "lz4", "zstd"}))
      ->capture_default_str();
  add_layer_options(*command, options->layers);
  add_open_options(*command, options->open);
  command->footer(
      "Examples:\n  understory convert walk.bag walk.mcap\n"
      "  understory convert walk.mcap walk_clouds --format ply\n"
      "  understory convert plot.laz plot.stems.csv.gz\n"
      "  understory convert RUN trees.geojson\n"
      "  understory convert RUN crowns.geojson --layer crowns\n"
      "  understory convert RUN --to 'PG:host=localhost dbname=forest'");
  command->callback([options, &chosen] {
    chosen = [options](CommandContext& context) { return run_convert(*options, context); };
  });
}

}  // namespace understory
