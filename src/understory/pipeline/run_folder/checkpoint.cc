#include "understory/pipeline/run_folder/checkpoint.h"

#include <algorithm>
#include <cstring>
#include <fstream>
#include <system_error>
#include <utility>

#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"
#include "understory/util/files/durable.h"
#include "understory/util/files/output_file.h"
#include "understory/util/files/record_file.h"

namespace understory {
namespace {

const std::string& mark() {
  static const std::string text =
      "UNDERSTORY CHECKPOINT " + std::to_string(kCheckpointFormat) + "\n";
  return text;
}

constexpr std::uintmax_t kMostCheckpointBytes = std::uintmax_t{1} << 32U;

// Before the content.
struct Head {
  std::uint64_t number = 0;
  std::uint64_t checksum = 0;  // of number and content
};

std::uint64_t checksum(std::uint64_t number, RecordFile::Bytes content) {
  return crc32_of(content, crc32_of(bytes_of(number)));
}

}  // namespace

std::filesystem::path checkpoint_file(const std::filesystem::path& work, std::uint64_t number) {
  return work / (number % 2 == 0 ? "checkpoint.bin" : "checkpoint.2.bin");
}

void write_checkpoint(const std::filesystem::path& work, std::uint64_t number,
                      const std::string& bytes) {
  const std::filesystem::path path = checkpoint_file(work, number);
  const Head head{number, checksum(number, bytes_of(bytes))};
  // The files that it counts on are found again only with the folder that holds them.
  sync_folder(work);
  AtomicFile file(path);
  file.write(mark());
  file.write({reinterpret_cast<const char*>(&head), sizeof(head)});
  file.write(bytes);
  file.commit();
}

Checkpoint parse_checkpoint(const std::filesystem::path& file, std::string bytes) {
  if (bytes.size() < mark().size() + sizeof(Head) || !bytes.starts_with(mark()))
    throw InputError(file.string(), "", "expected a checkpoint of this program version");
  Head head;
  std::memcpy(&head, bytes.data() + mark().size(), sizeof(head));
  bytes.erase(0, mark().size() + sizeof(Head));
  if (head.checksum != checksum(head.number, bytes_of(bytes)))
    throw InputError(file.string(), "", "the checkpoint is damaged (checksum)");
  return {file, head.number, std::move(bytes)};
}

std::vector<Checkpoint> read_checkpoints(const std::filesystem::path& work,
                                         std::vector<std::string>& problems) {
  std::vector<Checkpoint> whole;
  bool any = false;
  for (const std::uint64_t number : {0U, 1U}) {
    const std::filesystem::path path = checkpoint_file(work, number);
    std::error_code error;
    const std::uintmax_t size = std::filesystem::file_size(path, error);
    if (error) continue;
    any = true;
    try {
      if (size > kMostCheckpointBytes)
        throw InputError(path.string(), "", "is too large for a checkpoint");
      std::string bytes(size, '\0');
      std::ifstream file(path, std::ios::binary);
      if (!file.read(bytes.data(), static_cast<std::streamsize>(size)))
        throw InputError(path.string(), "", "cannot be read");
      whole.push_back(parse_checkpoint(path, std::move(bytes)));
    } catch (const InputError& problem) {
      problems.emplace_back(problem.what());
    }
  }
  if (!any) throw InputError(work.string(), "", "there is no checkpoint to go on from");
  std::sort(whole.begin(), whole.end(),
            [](const Checkpoint& a, const Checkpoint& b) { return a.number > b.number; });
  return whole;
}

}  // namespace understory
