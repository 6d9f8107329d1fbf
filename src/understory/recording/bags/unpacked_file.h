#pragma once

#include <map>
#include <memory>
#include <string>

#include "understory/util/log.h"

namespace understory {

// The unpacked copy of a file in zstd's format. It lies without a name in the folder for temporary
// files (TMPDIR, else /tmp). So it goes with its last reader, however the program ends.
class UnpackedFile {
 public:
  // What is damaged is unpacked as far as it goes. Throws InputError if the file cannot be opened,
  // ReadError where it cannot be read, OutputError where there is no room for the copy.
  explicit UnpackedFile(const std::string& packed);
  ~UnpackedFile();
  UnpackedFile(const UnpackedFile&) = delete;
  UnpackedFile& operator=(const UnpackedFile&) = delete;

  // A path under which this process can open the copy.
  [[nodiscard]] std::string path() const;
  // Where it breaks off and why; empty if it is whole.
  [[nodiscard]] const std::string& damage() const { return damage_; }

 private:
  void unpack(const std::string& packed);

  int descriptor_ = -1;
  std::string place_;  // for messages
  std::string damage_;
};

// The unpacked parts of one bag, for whoever looks ahead and then for whoever reads: each part is
// unpacked once. What was looked at ahead is kept until the reader has passed it. Not thread-safe.
class UnpackedParts {
 public:
  // True for the first who asks: the parts that it opens are kept for the next.
  [[nodiscard]] bool begin_pass() { return passes_++ == 0; }
  // Warns of damage in it each time.
  [[nodiscard]] std::shared_ptr<const UnpackedFile> get(const std::string& packed, Log& log);
  void forget(const std::string& packed) { kept_.erase(packed); }
  // How many files were unpacked so far.
  [[nodiscard]] int unpacked() const { return unpacked_; }

 private:
  std::map<std::string, std::shared_ptr<const UnpackedFile>> kept_;
  int passes_ = 0;
  int unpacked_ = 0;
};

}  // namespace understory
