#include "understory/recording/ros2_bag.h"

#include <unistd.h>
#include <yaml-cpp/yaml.h>
#include <zstd.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "understory/recording/byte_source.h"
#include "understory/recording/mcap_reader.h"
#include "understory/util/error.h"
#include "understory/util/output_file.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kUnpackStep = 1U << 20;

// An unpacked copy of a compressed file, removed at the end.
class TemporaryCopy {
 public:
  explicit TemporaryCopy(std::string path) : path_(std::move(path)) {}
  ~TemporaryCopy() {
    std::error_code ignored;
    fs::remove(path_, ignored);
  }
  TemporaryCopy(const TemporaryCopy&) = delete;
  TemporaryCopy& operator=(const TemporaryCopy&) = delete;
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
};

std::unique_ptr<TemporaryCopy> unpack_file(const std::string& path, Log& log) {
  const auto file = open_file(path);
  std::string pattern = (fs::temp_directory_path() / "understory_bag_XXXXXX").string();
  const int descriptor = ::mkstemp(pattern.data());
  if (descriptor < 0) throw OutputError(pattern, "no place for the unpacked copy of " + path);
  ::close(descriptor);
  auto copy = std::make_unique<TemporaryCopy>(pattern);
  OutputFile out(pattern);
  const std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> stream(ZSTD_createDStream(),
                                                                          &ZSTD_freeDStream);
  std::vector<std::uint8_t> packed;
  std::vector<std::uint8_t> piece(kUnpackStep);
  for (std::uint64_t at = 0; at < file->size(); at += packed.size()) {
    file->ByteSource::read(at, kUnpackStep, packed);
    if (packed.empty()) break;
    ZSTD_inBuffer in{packed.data(), packed.size(), 0};
    while (in.pos < in.size) {
      ZSTD_outBuffer buffer{piece.data(), piece.size(), 0};
      const std::size_t state = ZSTD_decompressStream(stream.get(), &buffer, &in);
      out.write(ByteSpan(piece).first(buffer.pos));
      if (ZSTD_isError(state) == 0) continue;
      log.warn("recording.damaged", path + ": at byte " + std::to_string(at + in.pos) +
                                        ": damaged zstd data; read as far as it goes");
      out.close();
      return copy;
    }
  }
  out.close();
  return copy;
}

bool has_ending(const std::string& name, const std::string& ending) {
  return name.size() >= ending.size() &&
         name.compare(name.size() - ending.size(), ending.size(), ending) == 0;
}

bool is_bag_file(const std::string& name) {
  for (const char* ending : {".db3", ".mcap", ".db3.zstd", ".mcap.zstd"}) {
    if (has_ending(name, ending)) return true;
  }
  return false;
}

// The files that metadata.yaml names and that are there, else those found in the folder by name.
std::vector<std::string> files_of(const std::string& folder, Log& log) {
  std::vector<std::string> files;
  const fs::path metadata = fs::path(folder) / "metadata.yaml";
  if (fs::exists(metadata)) {
    try {
      const YAML::Node info = YAML::LoadFile(metadata.string())["rosbag2_bagfile_information"];
      for (const auto& each : info["relative_file_paths"]) {
        const fs::path file = fs::path(folder) / each.as<std::string>();
        if (fs::exists(file)) {
          files.push_back(file.string());
        } else {
          log.warn("recording.missing_file",
                   metadata.string() + ": names " + file.string() + ", which is not there");
        }
      }
    } catch (const YAML::Exception& error) {
      log.warn("recording.damaged", metadata.string() + ": " + error.what() +
                                        "; taking the files of the folder by name");
      files.clear();
    }
  }
  if (!files.empty()) return files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file() && is_bag_file(entry.path().filename().string()))
      files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

// The parts of a split bag one after the other.
class BagFolderSource : public MessageSource {
 public:
  BagFolderSource(std::vector<std::string> files, Log& log) : files_(std::move(files)), log_(log) {
    open_next();
  }

  bool next(RawMessage& message) override {
    while (source_ != nullptr) {
      if (source_->next(message)) return true;
      open_next();
    }
    return false;
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
    while (source_ == nullptr && opened_ < files_.size()) {
      const std::string& file = files_[opened_++];
      try {
        source_ = open_part(file);
        format_ = source_->format();
      } catch (const InputError& error) {
        if (files_.size() == 1) throw;
        log_.warn("recording.damaged", std::string(error.what()) + "; this part is left out");
      }
    }
  }

  std::unique_ptr<MessageSource> open_part(const std::string& file) {
    std::string path = file;
    copy_.reset();
    if (has_ending(file, ".zstd")) {
      copy_ = unpack_file(file, log_);
      path = copy_->path();
    }
    if (has_ending(file, ".mcap") || has_ending(file, ".mcap.zstd"))
      return read_mcap(open_file(path), log_);
    return read_db3(path, log_);
  }

  std::vector<std::string> files_;
  Log& log_;
  std::size_t opened_ = 0;
  std::string format_ = "ROS 2 bag";
  std::unique_ptr<TemporaryCopy> copy_;
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

std::unique_ptr<MessageSource> read_ros2_bag_folder(const std::string& path, Log& log) {
  std::vector<std::string> files = files_of(path, log);
  if (files.empty()) throw InputError(path, "", "expected .db3 or .mcap files in the bag's folder");
  return std::make_unique<BagFolderSource>(std::move(files), log);
}

}  // namespace understory
