#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <memory>
#include <span>

#include <fmt/format.h>
#include <openssl/evp.h>

#include "understory/output/run_summary.h"
#include "understory/util/error.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

// The SHA-256 of what was given so far, with the processor's own instructions where it has them.
class Sha256 {
 public:
  Sha256() : context_(EVP_MD_CTX_new()) {
    check(context_ && EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr) == 1);
  }

  void update(const char* bytes, std::size_t count) {
    check(EVP_DigestUpdate(context_.get(), bytes, count) == 1);
  }

  std::string finish() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned int size = 0;
    check(EVP_DigestFinal_ex(context_.get(), digest.data(), &size) == 1);
    std::string text;
    for (const unsigned char byte : std::span(digest).first(size))
      text += fmt::format("{:02x}", byte);
    return text;
  }

 private:
  struct Free {
    void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
  };

  static void check(bool done) {
    if (!done) throw InternalError("the cryptographic library computes no SHA-256");
  }

  std::unique_ptr<EVP_MD_CTX, Free> context_;
};

}  // namespace

std::string hash_text(const std::string& text) {
  Sha256 hash;
  hash.update(text.data(), text.size());
  return hash.finish();
}

InputHash hash_input(const std::filesystem::path& path, const ProgressSink& progress) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(path.string(), "", std::strerror(errno));
  Sha256 hash;
  InputHash result;
  result.file = path.filename().string();
  std::vector<char> buffer(1U << 20);
  while (file.read(buffer.data(), static_cast<std::streamsize>(buffer.size())) ||
         file.gcount() > 0) {
    progress.poll();
    const auto count = static_cast<std::size_t>(file.gcount());
    hash.update(buffer.data(), count);
    result.bytes += count;
  }
  check_readable(file, path.string(), "at byte " + std::to_string(result.bytes));
  result.sha256 = hash.finish();
  return result;
}

}  // namespace understory
