#include "understory/recording/bags/ros2_bag.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <utility>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/bags/mcap_format.h"
#include "understory/recording/bags/mcap_reader.h"
#include "understory/recording/finding.h"
#include "understory/util/error.h"
#include "understory/util/files/read_error.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

bool has_ending(const std::string& name, const std::string& ending) {
  return name.size() >= ending.size() &&
         name.compare(name.size() - ending.size(), ending.size(), ending) == 0;
}

bool is_packed(const std::string& name) {
  return has_ending(name, ".zstd");
}

bool is_bag_file(const std::string& name) {
  for (const char* ending : {".db3", ".mcap", ".db3.zstd", ".mcap.zstd"}) {
    if (has_ending(name, ending)) return true;
  }
  return false;
}

// The files that metadata.yaml names and that are there; none where it cannot be understood.
std::vector<std::string> files_of_metadata(const std::string& folder, Log& log) {
  const std::string metadata = (fs::path(folder) / "metadata.yaml").string();
  std::error_code error;
  std::vector<std::string> files;
  if (!fs::exists(metadata, error)) return files;
  try {
    for (const std::string& name : bag_file_names(read_text_file(metadata), metadata)) {
      const std::string file = (fs::path(folder) / name).string();
      if (std::find(files.begin(), files.end(), file) != files.end()) continue;
      if (fs::exists(file, error)) {
        files.push_back(file);
      } else {
        log.warn("recording.missing_file", metadata + ": names " + file + ", which is not there");
      }
    }
  } catch (const ConfigError& problem) {
    report_finding(log, Finding::kDamage,
                   std::string(problem.what()) + "; taking the files of the folder by name");
    files.clear();
  }
  return files;
}

// Those that metadata.yaml names, else those found in the folder by name.
std::vector<std::string> files_of(const std::string& folder, Log& log) {
  std::vector<std::string> files = files_of_metadata(folder, log);
  if (!files.empty()) return files;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_regular_file(ignored) && is_bag_file(entry->path().filename().string()))
      files.push_back(entry->path().string());
  }
  if (error) throw InputError(folder, "", error.message());
  std::sort(files.begin(), files.end());
  return files;
}

bool is_mcap(ByteSource& file) {
  std::vector<std::uint8_t> head;
  file.read(0, sizeof(mcap::kMagic), head);
  return head.size() == sizeof(mcap::kMagic) &&
         std::memcmp(head.data(), mcap::kMagic, sizeof(mcap::kMagic)) == 0;
}

// The parts of a split bag one after the other.
class BagFilesSource : public MessageSource {
 public:
  BagFilesSource(std::vector<std::string> files, std::shared_ptr<UnpackedParts> unpacked, Log& log)
      : files_(std::move(files)),
        unpacked_(std::move(unpacked)),
        looks_ahead_(unpacked_->begin_pass()),
        log_(log) {
    open_next();
  }

  bool next(RawMessage& message) override {
    while (source_ != nullptr) {
      if (source_->next(message)) return true;
      open_next();
    }
    return false;
  }
  void save(BinaryWriter& writer) const override {
    writer.put(static_cast<std::uint64_t>(opened_));
    writer.put(format_);
    writer.put(source_ != nullptr);
    if (source_ != nullptr) source_->save(writer);
  }
  void load(BinaryReader& reader) override {
    source_.reset();
    copy_.reset();
    opened_ = static_cast<std::size_t>(reader.get<std::uint64_t>());
    if (opened_ > files_.size())
      throw InputError(files_.front(), "", "the bag has fewer parts than when the run was begun");
    for (std::size_t i = 0; i + 1 < opened_; ++i)
      unpacked_->forget(files_[i]);
    format_ = reader.get_string();
    if (!reader.get<bool>() || opened_ == 0) return;
    source_ = open_part(files_[opened_ - 1]);
    source_->load(reader);
  }
  [[nodiscard]] std::string format() const override { return format_; }
  [[nodiscard]] double progress() const override {
    const double done = static_cast<double>(opened_) - (source_ == nullptr ? 0.0 : 1.0);
    const double part = source_ == nullptr ? 0.0 : source_->progress();
    return (done + part) / static_cast<double>(files_.size());
  }
  [[nodiscard]] std::map<std::string, std::string> sensor_metadata() const override {
    return source_ == nullptr ? std::map<std::string, std::string>() : source_->sensor_metadata();
  }
  // Of parts that need not be unpacked for it.
  [[nodiscard]] std::vector<StoredMessage> first_messages(const WantedChannel& wanted,
                                                          std::size_t most) override {
    std::vector<StoredMessage> all;
    for (const std::string& file : files_) {
      if (has_ending(file, ".zstd")) continue;
      try {
        Log quiet;  // what is wrong is said when the part is read
        const auto part =
            has_ending(file, ".mcap") ? read_mcap(open_file(file), quiet) : read_db3(file, quiet);
        for (StoredMessage& each : part->first_messages(wanted, most))
          all.push_back(std::move(each));
      } catch (const InputError&) {
        continue;
      }
    }
    return all;
  }

 private:
  // A part that cannot be opened is left out, unless it is the only one.
  void open_next() {
    source_.reset();
    copy_.reset();
    if (opened_ > 0 && !looks_ahead_) unpacked_->forget(files_[opened_ - 1]);
    while (source_ == nullptr && opened_ < files_.size()) {
      const std::string& file = files_[opened_++];
      try {
        source_ = open_part(file);
        format_ = source_->format();
      } catch (const ReadError&) {
        throw;
      } catch (const InputError& error) {
        if (files_.size() == 1) throw;
        report_finding(log_, Finding::kDamage,
                       std::string(error.what()) + "; this part is left out");
      }
    }
  }

  std::unique_ptr<MessageSource> open_part(const std::string& file) {
    std::string path = file;
    if (is_packed(file)) {
      copy_ = unpacked_->get(file, log_);
      path = copy_->path();
    }
    auto bytes = open_file(path, file);
    if (is_mcap(*bytes)) return read_mcap(std::move(bytes), log_);
    return copy_ == nullptr ? read_db3(file, log_) : read_db3(std::move(bytes), log_);
  }

  std::vector<std::string> files_;
  std::shared_ptr<UnpackedParts> unpacked_;
  bool looks_ahead_;
  Log& log_;
  std::size_t opened_ = 0;
  std::string format_ = "ROS 2 bag";
  std::shared_ptr<const UnpackedFile> copy_;
  std::unique_ptr<MessageSource> source_;
};

}  // namespace

bool is_ros2_bag_folder(const std::string& path) {
  std::error_code error;
  for (fs::directory_iterator entry(path, error), end; !error && entry != end;
       entry.increment(error)) {
    if (is_bag_file(entry->path().filename().string())) return true;
  }
  return false;
}

std::vector<std::string> bag_parts_outside(const std::string& path) {
  std::vector<std::string> outside;
  if (!is_ros2_bag_folder(path)) return outside;
  Log quiet;  // what is wrong is said when the bag is read
  const fs::path folder = fs::absolute(path).lexically_normal();
  for (const std::string& file : files_of_metadata(path, quiet)) {
    const fs::path below = fs::absolute(file).lexically_normal().lexically_relative(folder);
    if (below.empty() || *below.begin() == "..")
      outside.push_back(fs::path(file).lexically_normal().string());
  }
  return outside;
}

std::vector<std::string> bag_file_names(const std::string& metadata, const std::string& origin) {
  const YAML::Node root = load_yaml(metadata, origin);
  std::vector<std::string> names;
  try {
    const YAML::Node info = root["rosbag2_bagfile_information"];
    for (const auto& each : info["relative_file_paths"])
      names.push_back(each.as<std::string>());
  } catch (const YAML::Exception& error) {
    throw ConfigError({origin + ":" + std::to_string(error.mark.line + 1) + ": " + error.msg});
  }
  return names;
}

std::unique_ptr<MessageSource> read_ros2_bag(const std::string& path,
                                             std::shared_ptr<UnpackedParts> unpacked, Log& log) {
  std::error_code error;
  std::vector<std::string> files{path};
  if (fs::is_directory(path, error)) files = files_of(path, log);
  if (files.empty()) throw InputError(path, "", "expected .db3 or .mcap files in the bag's folder");
  return std::make_unique<BagFilesSource>(std::move(files), std::move(unpacked), log);
}

}  // namespace understory
