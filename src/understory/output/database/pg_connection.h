#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace understory {

// A connection to a PostgreSQL server with one transaction, which is undone unless it is committed.
// Its messages never hold the password. Not thread-safe.
class PgConnection {
 public:
  // `target`: "host=... dbname=..." or "postgresql://...", as libpq takes it. A server that does
  // not answer is given up after seconds. Begins the transaction. Throws ConfigError where it is no
  // such text, OutputError where there is no connection.
  explicit PgConnection(const std::string& target);
  ~PgConnection();
  PgConnection(const PgConnection&) = delete;
  PgConnection& operator=(const PgConnection&) = delete;

  // "database forest at localhost:5432".
  [[nodiscard]] const std::string& name() const { return name_; }
  // Runs one statement. Throws OutputError with the server's words.
  void run(const std::string& sql);
  // How many rows a statement changed.
  [[nodiscard]] std::size_t count_changed(const std::string& sql);
  // The first column of a query's first row; empty without a row or of NULL.
  [[nodiscard]] std::string value_of(const std::string& sql);
  // A text as a literal of SQL, and a name as an identifier, quoted.
  [[nodiscard]] std::string literal(const std::string& text) const;
  [[nodiscard]] static std::string identifier(const std::string& name);
  // Sends rows in the text format of COPY: `next` gives one line after the other, empty at the end.
  void copy(const std::string& sql, const std::function<std::string()>& next);
  void commit();

 private:
  struct Impl;
  [[noreturn]] void fail(const std::string& what) const;
  std::unique_ptr<Impl> impl_;
  std::string name_;
};

// A text as a field of COPY's text format.
[[nodiscard]] std::string copy_field(const std::string& text);

}  // namespace understory
