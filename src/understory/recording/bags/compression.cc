#include "understory/recording/bags/compression.h"

#include <bzlib.h>
#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <memory>

#include "understory/util/error.h"

namespace understory {
namespace {

constexpr std::size_t kStep = 1U << 18;

// Room in `out` for the next step, at most up to `limit`; 0 if the limit is reached. All that is
// reserved is room: zstd unpacks a frame that fits straight into it, without a window of its own.
std::size_t make_room(std::vector<std::uint8_t>& out, std::uint64_t limit) {
  const std::size_t used = out.size();
  const std::size_t wanted = std::max({kStep, used / 2, out.capacity() - used});
  const auto size = static_cast<std::size_t>(std::min<std::uint64_t>(limit, used + wanted));
  out.resize(size);
  return size - used;
}

std::string unpack_zstd(ByteSpan packed, std::uint64_t limit, std::vector<std::uint8_t>& out) {
  const std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> stream(ZSTD_createDStream(),
                                                                          &ZSTD_freeDStream);
  ZSTD_DCtx_setParameter(stream.get(), ZSTD_d_windowLogMax, 27);
  ZSTD_inBuffer in{packed.data(), packed.size(), 0};
  std::size_t state = 1;
  while (true) {
    const std::size_t used = out.size();
    const std::size_t room = make_room(out, limit);
    ZSTD_outBuffer piece{out.data() + used, room, 0};
    state = ZSTD_decompressStream(stream.get(), &piece, &in);
    out.resize(used + piece.pos);
    if (ZSTD_isError(state) != 0) return ZSTD_getErrorName(state);
    if (state == 0 && in.pos == in.size) return "";
    if (piece.pos == 0 && in.pos == in.size) return "zstd data ends too early";
    if (room == 0 && piece.pos == 0) return "unpacks to more than it should";
  }
}

std::string unpack_lz4(ByteSpan packed, std::uint64_t limit, std::vector<std::uint8_t>& out) {
  LZ4F_dctx* raw = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&raw, LZ4F_VERSION)) != 0)
    return "no memory for lz4";
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(
      raw, &LZ4F_freeDecompressionContext);
  std::size_t position = 0;
  while (true) {
    const std::size_t used = out.size();
    std::size_t produced = make_room(out, limit);
    const bool full = produced == 0;
    std::size_t consumed = packed.size() - position;
    const std::size_t hint = LZ4F_decompress(context.get(), out.data() + used, &produced,
                                             packed.data() + position, &consumed, nullptr);
    const bool failed = LZ4F_isError(hint) != 0;
    out.resize(used + (failed ? 0 : produced));
    if (failed) return LZ4F_getErrorName(hint);
    position += consumed;
    if (hint == 0 && position == packed.size()) return "";
    if (produced == 0 && consumed == 0)
      return full ? "unpacks to more than it should" : "lz4 data ends too early";
  }
}

std::string unpack_bz2(ByteSpan packed, std::uint64_t limit, std::vector<std::uint8_t>& out) {
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) return "no memory for bz2";
  const std::unique_ptr<bz_stream, decltype(&BZ2_bzDecompressEnd)> guard(&stream,
                                                                         &BZ2_bzDecompressEnd);
  stream.next_in = const_cast<char*>(reinterpret_cast<const char*>(packed.data()));
  stream.avail_in = static_cast<unsigned int>(packed.size());
  while (true) {
    const std::size_t used = out.size();
    const std::size_t room = make_room(out, limit);
    stream.next_out = reinterpret_cast<char*>(out.data() + used);
    stream.avail_out = static_cast<unsigned int>(room);
    const unsigned int input_before = stream.avail_in;
    const int state = BZ2_bzDecompress(&stream);
    const std::size_t produced = room - stream.avail_out;
    out.resize(used + produced);
    if (state == BZ_STREAM_END) return "";
    if (state != BZ_OK) return "bz2 data is damaged";
    if (produced == 0 && stream.avail_in == input_before)
      return room == 0 ? "unpacks to more than it should" : "bz2 data ends too early";
  }
}

std::vector<std::uint8_t> pack_zstd(ByteSpan bytes, int level) {
  std::vector<std::uint8_t> packed(ZSTD_compressBound(bytes.size()));
  const std::size_t size =
      ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), level);
  UNDERSTORY_CHECK(ZSTD_isError(size) == 0);
  packed.resize(size);
  return packed;
}

std::vector<std::uint8_t> pack_lz4(ByteSpan bytes) {
  std::vector<std::uint8_t> packed(LZ4F_compressFrameBound(bytes.size(), nullptr));
  const std::size_t size =
      LZ4F_compressFrame(packed.data(), packed.size(), bytes.data(), bytes.size(), nullptr);
  UNDERSTORY_CHECK(LZ4F_isError(size) == 0);
  packed.resize(size);
  return packed;
}

}  // namespace

std::vector<std::uint8_t> compress(ByteSpan bytes, std::string_view method, int zstd_level) {
  UNDERSTORY_CHECK(method == "zstd" || method == "lz4");
  return method == "zstd" ? pack_zstd(bytes, zstd_level) : pack_lz4(bytes);
}

std::string decompress(ByteSpan packed, std::string_view method, std::uint64_t limit,
                       std::vector<std::uint8_t>& out) {
  limit = std::min(limit, kLongestBlock);
  out.clear();
  // The promised length is used as far as such data usually shrink.
  out.reserve(static_cast<std::size_t>(std::min<std::uint64_t>(limit, 16 * packed.size())));
  if (method == "zstd") return unpack_zstd(packed, limit, out);
  if (method == "lz4") return unpack_lz4(packed, limit, out);
  if (method == "bz2") return unpack_bz2(packed, limit, out);
  return "unknown compression \"" + std::string(method.substr(0, 16)) + "\"";
}

}  // namespace understory
