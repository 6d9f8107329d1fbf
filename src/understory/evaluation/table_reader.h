#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace understory {

// Reads a text file line by line, plain or gzip by its content. Not thread-safe.
class LineReader {
 public:
  // Throws InputError if the file cannot be opened.
  explicit LineReader(const std::filesystem::path& path);
  ~LineReader();
  LineReader(const LineReader&) = delete;
  LineReader& operator=(const LineReader&) = delete;

  // The next line without its end; false at the end of the file. Throws InputError where the
  // compressed stream is damaged, or a line is longer than a megabyte; ReadError where the system
  // cannot read the file.
  bool next(std::string& line);
  [[nodiscard]] std::size_t line_number() const { return line_number_; }
  [[nodiscard]] std::string position() const { return "line " + std::to_string(line_number_); }
  [[nodiscard]] std::string file() const { return path_.string(); }

 private:
  struct Stream;
  std::filesystem::path path_;
  std::unique_ptr<Stream> stream_;
  std::size_t line_number_ = 0;
};

// Splits at any of the separators; neighbouring separators count as one only if `merge`.
[[nodiscard]] std::vector<std::string_view> split(std::string_view line,
                                                  std::string_view separators, bool merge);
// The whole text as a number (nan and inf included); false if it is not one.
[[nodiscard]] bool parse_number(std::string_view text, double& value);

// A CSV table with a header line, read row by row, columns found by name. Not thread-safe.
class CsvReader {
 public:
  // Throws InputError if the file cannot be opened or a required column is missing.
  CsvReader(const std::filesystem::path& path, const std::vector<std::string>& required);

  bool next();  // moves to the next row; empty lines and comments (#) are passed over
  [[nodiscard]] bool has(const std::string& column) const { return columns_.count(column) > 0; }
  // The cell's text, empty if the column is absent.
  [[nodiscard]] std::string_view text(const std::string& column) const;
  // The cell as a number; NaN if the column is absent or the cell empty. Throws InputError with the
  // line on anything else.
  [[nodiscard]] double number(const std::string& column) const;
  // As number(), but an absent, empty or non-finite value is an InputError too.
  [[nodiscard]] double finite(const std::string& column) const;
  [[nodiscard]] const LineReader& lines() const { return lines_; }

 private:
  LineReader lines_;
  std::map<std::string, std::size_t, std::less<>> columns_;
  std::size_t width_ = 0;  // cells of the header; a name may stand there twice
  std::string line_;
  std::vector<std::string_view> cells_;
};

}  // namespace understory
