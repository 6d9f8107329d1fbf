#include "understory/output/copc/chunk_table.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace understory {
namespace {

// Of the coder: least length of its interval, bits of a probability of a symbol and of a bit.
constexpr std::uint32_t kLeastLength = 0x01000000U;
constexpr std::uint32_t kSymbolBits = 15;
constexpr std::uint32_t kBitBits = 13;
// Of the integer compressor: bits of a corrector, and its high bits that a model codes.
constexpr std::uint32_t kBits = 32;
constexpr std::uint32_t kHighBits = 8;

// An adaptive model of a symbol out of `symbols`.
class SymbolModel {
 public:
  explicit SymbolModel(std::uint32_t symbols) : counts_(symbols, 1), below_(symbols, 0) {
    cycle_ = symbols;
    update();
    left_ = cycle_ = (symbols + 6) >> 1U;
  }
  [[nodiscard]] std::uint32_t below(std::uint32_t symbol) const { return below_[symbol]; }
  [[nodiscard]] std::uint32_t last() const {
    return static_cast<std::uint32_t>(counts_.size()) - 1;
  }
  void count(std::uint32_t symbol) {
    ++counts_[symbol];
    if (--left_ == 0) update();
  }

 private:
  void update() {
    total_ += cycle_;
    if (total_ > 1U << kSymbolBits) {
      total_ = 0;
      for (std::uint32_t& count : counts_)
        total_ += count = (count + 1) >> 1U;
    }
    const std::uint32_t scale = 0x80000000U / total_;
    std::uint32_t sum = 0;
    for (std::size_t i = 0; i < counts_.size(); ++i) {
      below_[i] = (scale * sum) >> (31 - kSymbolBits);
      sum += counts_[i];
    }
    const auto symbols = static_cast<std::uint32_t>(counts_.size());
    left_ = cycle_ = std::min((5 * cycle_) >> 2U, (symbols + 6) << 3U);
  }

  std::vector<std::uint32_t> counts_;
  std::vector<std::uint32_t> below_;  // of the symbols before each, in 2^-15
  std::uint32_t total_ = 0;
  std::uint32_t cycle_ = 0;
  std::uint32_t left_ = 0;  // symbols until the next update
};

// The same of a bit.
class BitModel {
 public:
  [[nodiscard]] std::uint32_t zero() const { return zero_; }
  void count(std::uint32_t bit) {
    zeros_ += bit == 0 ? 1 : 0;
    if (--left_ == 0) update();
  }

 private:
  void update() {
    total_ += cycle_;
    if (total_ > 1U << kBitBits) {
      total_ = (total_ + 1) >> 1U;
      zeros_ = (zeros_ + 1) >> 1U;
      if (zeros_ == total_) ++total_;
    }
    zero_ = (zeros_ * (0x80000000U / total_)) >> (31 - kBitBits);
    left_ = cycle_ = std::min((5 * cycle_) >> 2U, std::uint32_t{64});
  }

  std::uint32_t zeros_ = 1;
  std::uint32_t total_ = 2;
  std::uint32_t zero_ = 1U << (kBitBits - 1);  // probability of 0, in 2^-13
  std::uint32_t cycle_ = 4;
  std::uint32_t left_ = 4;
};

class ArithmeticEncoder {
 public:
  explicit ArithmeticEncoder(std::string& out) : out_(out) {}

  void symbol(SymbolModel& model, std::uint32_t symbol) {
    std::uint32_t from = 0;
    if (symbol == model.last()) {
      from = model.below(symbol) * (length_ >> kSymbolBits);
      length_ -= from;
    } else {
      length_ >>= kSymbolBits;
      from = model.below(symbol) * length_;
      length_ = model.below(symbol + 1) * length_ - from;
    }
    advance(from);
    model.count(symbol);
  }
  void bit(BitModel& model, std::uint32_t bit) {
    const std::uint32_t split = model.zero() * (length_ >> kBitBits);
    if (bit == 0) {
      length_ = split;
    } else {
      length_ -= split;
    }
    advance(bit == 0 ? 0 : split);
    model.count(bit);
  }
  void raw(std::uint32_t bits, std::uint32_t value) {
    constexpr std::uint32_t kMostAtOnce = 19;
    constexpr std::uint32_t kShort = 16;
    if (bits > kMostAtOnce) {
      raw(kShort, value & 0xFFFFU);
      value >>= kShort;
      bits -= kShort;
    }
    length_ >>= bits;
    advance(value * length_);
  }
  void finish() {
    const bool one_more = length_ > 2 * kLeastLength;
    length_ = one_more ? kLeastLength >> 1U : kLeastLength >> 9U;
    advance(one_more ? kLeastLength : kLeastLength >> 1U);
    // The decoder reads ahead.
    out_.append(one_more ? 3 : 2, '\0');
  }

 private:
  void advance(std::uint32_t by) {
    const std::uint32_t before = base_;
    base_ += by;
    if (before > base_) carry();
    while (length_ < kLeastLength) {
      out_.push_back(static_cast<char>(base_ >> 24U));
      base_ <<= 8U;
      length_ <<= 8U;
    }
  }
  void carry() {
    std::size_t at = out_.size();
    while (at > 0 && out_[--at] == '\xFF')
      out_[at] = '\0';
    out_[at] = static_cast<char>(out_[at] + 1);
  }

  std::string& out_;
  std::uint32_t base_ = 0;
  std::uint32_t length_ = 0xFFFFFFFFU;
};

// Of differences of numbers of 32 bits, in two contexts.
class IntegerCompressor {
 public:
  explicit IntegerCompressor(ArithmeticEncoder& encoder) : encoder_(encoder) {
    for (std::uint32_t bits = 1; bits <= kBits; ++bits)
      correctors_.emplace_back(1U << std::min(bits, kHighBits));
  }
  void add(std::uint32_t before, std::uint32_t now, std::size_t context) {
    const auto difference = static_cast<std::int32_t>(now - before);
    const std::int64_t c = difference;
    // The least k so that c lies in [-(2^k - 1), 2^k].
    std::uint32_t k = 0;
    for (std::int64_t rest = c <= 0 ? -c : c - 1; rest > 0; rest >>= 1)
      ++k;
    encoder_.symbol(intervals_[context], k);
    if (k == 0) return encoder_.bit(one_, static_cast<std::uint32_t>(c));
    if (k == kBits) return;
    const auto place = static_cast<std::uint32_t>(c < 0 ? c + (std::int64_t{1} << k) - 1 : c - 1);
    SymbolModel& model = correctors_[k - 1];
    if (k <= kHighBits) return encoder_.symbol(model, place);
    const std::uint32_t low = k - kHighBits;
    encoder_.symbol(model, place >> low);
    encoder_.raw(low, place & ((1U << low) - 1));
  }

 private:
  ArithmeticEncoder& encoder_;
  std::array<SymbolModel, 2> intervals_{SymbolModel(kBits + 1), SymbolModel(kBits + 1)};
  BitModel one_;
  std::vector<SymbolModel> correctors_;
};

void put(std::string& out, std::uint32_t value) {
  for (int shift = 0; shift < 32; shift += 8)
    out.push_back(static_cast<char>(value >> shift));
}

}  // namespace

std::string laz_chunk_table(const std::vector<LazChunk>& chunks) {
  constexpr std::uint32_t kVersion = 0;
  std::string table;
  put(table, kVersion);
  put(table, static_cast<std::uint32_t>(chunks.size()));
  if (chunks.empty()) return table;
  std::string coded;
  ArithmeticEncoder encoder(coded);
  IntegerCompressor numbers(encoder);
  LazChunk before;
  for (const LazChunk& chunk : chunks) {
    numbers.add(before.points, chunk.points, 0);
    numbers.add(before.bytes, chunk.bytes, 1);
    before = chunk;
  }
  encoder.finish();
  return table + coded;
}

}  // namespace understory
