#include "understory/output/copc/point_cells.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <string>
#include <utility>

#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"
#include "understory/util/parallel.h"

namespace understory {

// The file without a name.
struct PointCells::Spill {
  explicit Spill(const std::filesystem::path& file) : name(file.string()) {
    const std::string path = part_path(file).string() + ".points";
    descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (descriptor < 0) fail();
    ::unlink(path.c_str());
  }
  ~Spill() { ::close(descriptor); }
  Spill(const Spill&) = delete;
  Spill& operator=(const Spill&) = delete;

  [[noreturn]] void fail() const {
    throw OutputError(name, std::string("cannot be written: ") + std::strerror(errno));
  }
  void append(const std::vector<LasPointSteps>& part) {
    const auto* at = reinterpret_cast<const char*>(part.data());
    std::size_t left = part.size() * sizeof(LasPointSteps);
    auto place = static_cast<off_t>(points * sizeof(LasPointSteps));
    while (left > 0) {
      const ssize_t written = ::pwrite(descriptor, at, left, place);
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) fail();
      at += written;
      place += written;
      left -= static_cast<std::size_t>(written);
    }
    points += part.size();
  }
  void read(const Cell::Block& block, std::vector<LasPointSteps>& into) const {
    into.resize(block.points);
    auto* at = reinterpret_cast<char*>(into.data());
    std::size_t left = into.size() * sizeof(LasPointSteps);
    auto place = static_cast<off_t>(block.first * sizeof(LasPointSteps));
    while (left > 0) {
      const ssize_t got = ::pread(descriptor, at, left, place);
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0)
        throw OutputError(name, std::string("its points cannot be read back: ") +
                                    (got < 0 ? std::strerror(errno) : "the file ends"));
      at += got;
      place += got;
      left -= static_cast<std::size_t>(got);
    }
  }

  std::string name;
  int descriptor = -1;
  std::uint64_t points = 0;
};

PointCells::PointCells(std::filesystem::path file, int bits, std::uint64_t in_memory)
    : file_(std::move(file)), bits_(bits), in_memory_(in_memory) {}

PointCells::~PointCells() = default;

void PointCells::add(const LasPointSteps& point) {
  waiting_.push_back(point);
  if (waiting_.size() >= in_memory_) move_to_disk();
}

std::vector<std::uint32_t> PointCells::sorted(std::uint64_t first) {
  std::vector<std::pair<Key, std::uint32_t>> keys(waiting_.size());
  parallel_for(keys.size(), 65'536, [&](std::size_t i) {
    const LasPointSteps& point = waiting_[i];
    keys[i] = {{point.x >> bits_, point.y >> bits_, point.z >> bits_},
               static_cast<std::uint32_t>(i)};
  });
  std::sort(keys.begin(), keys.end());
  std::vector<std::uint32_t> order(keys.size());
  Cell* cell = nullptr;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const Key& key = keys[i].first;
    order[i] = keys[i].second;
    if (i == 0 || keys[i - 1].first != key) {
      cell = &cells_[key];
      for (std::size_t axis = 0; axis < 3; ++axis)
        cell->low[axis] = static_cast<std::int64_t>(key[axis]) * (std::int64_t{1} << bits_);
      cell->blocks.push_back({first + i, 0});
    }
    ++cell->blocks.back().points;
    ++cell->points;
  }
  return order;
}

void PointCells::move_to_disk() {
  constexpr std::size_t kAtOnce = 65'536;
  if (spill_ == nullptr) spill_ = std::make_unique<Spill>(file_);
  std::vector<LasPointSteps> part;
  part.reserve(kAtOnce);
  for (const std::uint32_t i : sorted(spill_->points)) {
    part.push_back(waiting_[i]);
    if (part.size() < kAtOnce) continue;
    spill_->append(part);
    part.clear();
  }
  spill_->append(part);
  waiting_.clear();
}

void PointCells::settle() {
  if (spill_ != nullptr) {
    move_to_disk();
    waiting_ = {};
    return;
  }
  std::vector<LasPointSteps> in_order;
  in_order.reserve(waiting_.size());
  for (const std::uint32_t i : sorted(0))
    in_order.push_back(waiting_[i]);
  waiting_ = std::move(in_order);
}

PointCells::Cells PointCells::all() const {
  Cells cells;
  for (const auto& [key, cell] : cells_)
    cells.push_back(&cell);
  return cells;
}

std::uint64_t PointCells::count(const Cells& cells) {
  std::uint64_t points = 0;
  for (const Cell* cell : cells)
    points += cell->points;
  return points;
}

void PointCells::visit(const Cells& cells,
                       const std::function<void(std::span<const LasPointSteps>)>& visitor) const {
  std::vector<LasPointSteps> read;
  for (const Cell* cell : cells) {
    for (const Cell::Block& block : cell->blocks) {
      if (spill_ == nullptr) {
        visitor(std::span(waiting_).subspan(block.first, block.points));
      } else {
        spill_->read(block, read);
        visitor(read);
      }
    }
  }
}

}  // namespace understory
