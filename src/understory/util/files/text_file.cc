#include "understory/util/files/text_file.h"

#include <fcntl.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <vector>

#include "understory/util/files/read_error.h"

namespace understory {
namespace {

constexpr std::size_t kLongestYaml = std::size_t{16} << 20;
constexpr int kDeepestYaml = 64;
constexpr std::size_t kMostYamlValues = 1'000'000;

class ReadOnlyFile {
 public:
  explicit ReadOnlyFile(const std::string& path)
      : value_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (value_ < 0)
      throw InputError(path, "", std::string("cannot be opened: ") + std::strerror(errno));
  }
  ~ReadOnlyFile() { ::close(value_); }
  ReadOnlyFile(const ReadOnlyFile&) = delete;
  ReadOnlyFile& operator=(const ReadOnlyFile&) = delete;
  [[nodiscard]] int value() const { return value_; }

 private:
  int value_;
};

// An alias may name what it stands in, and aliases of aliases grow without limit. A walk over the
// document must not follow them for ever.
void check_size(const YAML::Node& node, int depth, std::size_t& left) {
  if (depth > kDeepestYaml)
    throw YAML::ParserException(node.Mark(), "nested in more than 64 levels");
  if (left-- == 0) throw YAML::ParserException(node.Mark(), "holds more than a million values");
  if (node.IsSequence()) {
    for (const YAML::Node& item : node)
      check_size(item, depth + 1, left);
  } else if (node.IsMap()) {
    for (const auto& entry : node) {
      check_size(entry.first, depth + 1, left);
      check_size(entry.second, depth + 1, left);
    }
  }
}

}  // namespace

ReadError::ReadError(const std::string& file, const std::string& position, int code)
    : InputError(file, position,
                 "cannot be read: " + std::error_code(code, std::generic_category()).message()) {}

std::string read_text_file(const std::string& path, std::uint64_t max_bytes) {
  const ReadOnlyFile file(path);
  std::string text;
  std::vector<char> part(std::size_t{1} << 16);
  while (true) {
    const ssize_t got = ::read(file.value(), part.data(), part.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw ReadError(path, "at byte " + std::to_string(text.size()), errno);
    if (got == 0) return text;
    text.append(part.data(), static_cast<std::size_t>(got));
    if (text.size() > max_bytes)
      throw InputError(path, "",
                       "expected a text of at most " + std::to_string(max_bytes) + " bytes");
  }
}

void check_readable(const std::istream& stream, const std::string& file,
                    const std::string& position) {
  const int code = errno;
  if (stream.bad()) throw ReadError(file, position, code != 0 ? code : EIO);
}

bool read_line(std::istream& stream, std::string& line, const std::string& file,
               std::uint64_t number) {
  if (std::getline(stream, line)) return true;
  check_readable(stream, file, "line " + std::to_string(number));
  return false;
}

YAML::Node load_yaml(const std::string& text, const std::string& origin) {
  if (text.size() > kLongestYaml) throw ConfigError({origin + ": expected at most 16 MiB of YAML"});
  try {
    YAML::Node root = YAML::Load(text);
    std::size_t left = kMostYamlValues;
    check_size(root, 0, left);
    return root;
  } catch (const YAML::Exception& error) {
    throw ConfigError({origin + ":" + std::to_string(error.mark.line + 1) + ": " + error.msg});
  }
}

}  // namespace understory
