#pragma once

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "understory/recording/messages/message_source.h"

#include "understory/util/stable_sort.h"

namespace understory {

// A part of a container file in memory (a chunk, unpacked) with the places of its messages.
struct MessageBlock {
  struct Entry {
    TimeNs log_time = 0;
    std::shared_ptr<const MessageChannel> channel;
    std::size_t offset = 0;
    std::size_t length = 0;
  };
  std::uint64_t place = 0;  // in the file; one block each
  std::vector<std::uint8_t> bytes;
  std::vector<Entry> entries;
};

// Keeps those of one channel, until there are `enough` in all.
inline void keep_messages(const MessageBlock& block, const MessageChannel& channel,
                          std::size_t enough, std::vector<StoredMessage>& kept) {
  for (const MessageBlock::Entry& entry : block.entries) {
    if (kept.size() >= enough) return;
    if (entry.channel.get() != &channel) continue;
    const auto begin = block.bytes.begin() + static_cast<std::ptrdiff_t>(entry.offset);
    kept.push_back({entry.channel,
                    entry.log_time,
                    {begin, begin + static_cast<std::ptrdiff_t>(entry.length)}});
  }
}

// Hands out the messages of several blocks by log time; equal times in the order in which they were
// added. Not thread-safe.
class MessageMerger {
 public:
  void add(MessageBlock block) {
    if (block.entries.empty()) return;
    sort_stably(block.entries,
                [](const auto& a, const auto& b) { return a.log_time < b.log_time; });
    bytes_ += block.bytes.size();
    blocks_.push_back({std::move(block), 0});
  }
  // Drops blocks that are used up, the last message's block with them.
  void tidy() {
    std::erase_if(blocks_, [&](Reading& reading) {
      const bool done = reading.next >= reading.block.entries.size();
      if (done) {
        bytes_ -= reading.block.bytes.size();
        spare_ = std::move(reading.block.bytes);
      }
      return done;
    });
  }
  // The memory of a block that was dropped, for the next one.
  [[nodiscard]] std::vector<std::uint8_t> take_spare() { return std::move(spare_); }
  // Valid after `tidy` and before the next `add`.
  [[nodiscard]] bool empty() const { return blocks_.empty(); }
  [[nodiscard]] TimeNs earliest() const { return first()->time(); }
  [[nodiscard]] std::size_t blocks() const { return blocks_.size(); }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

  // A block that is being handed out, and how many of its messages have been, of how many.
  struct Progress {
    std::uint64_t place = 0;
    std::uint64_t given = 0;
    std::uint64_t of = 0;
  };
  // Of all of them, in the order in which they were added.
  [[nodiscard]] std::vector<Progress> progress() const {
    std::vector<Progress> all;
    for (const Reading& reading : blocks_) {
      if (reading.next < reading.block.entries.size())
        all.push_back({reading.block.place, reading.next, reading.block.entries.size()});
    }
    return all;
  }
  // Passes over the messages that had been given of a block that was added once more. False if it
  // has no message behind them, or another number than before. A channel that is described only
  // behind the block is known when the block is read again.
  [[nodiscard]] bool pass(const Progress& progress) {
    if (blocks_.empty() || blocks_.back().block.place != progress.place ||
        blocks_.back().block.entries.size() != progress.of || progress.given >= progress.of)
      return false;
    blocks_.back().next = static_cast<std::size_t>(progress.given);
    return true;
  }

  // The earliest message; its data stay valid until `tidy`.
  [[nodiscard]] bool next(RawMessage& message) {
    if (blocks_.empty()) return false;
    Reading& reading = blocks_[static_cast<std::size_t>(first() - blocks_.begin())];
    const MessageBlock::Entry& entry = reading.block.entries[reading.next++];
    message.channel = entry.channel;
    message.log_time = entry.log_time;
    message.data = ByteSpan(reading.block.bytes).subspan(entry.offset, entry.length);
    return true;
  }

 private:
  struct Reading {
    MessageBlock block;
    std::size_t next = 0;
    [[nodiscard]] TimeNs time() const { return block.entries[next].log_time; }
  };
  [[nodiscard]] std::vector<Reading>::const_iterator first() const {
    return std::min_element(blocks_.begin(), blocks_.end(),
                            [](const auto& a, const auto& b) { return a.time() < b.time(); });
  }

  std::vector<Reading> blocks_;
  std::vector<std::uint8_t> spare_;
  std::uint64_t bytes_ = 0;
};

}  // namespace understory
