#include "understory/output/database/pg_connection.h"

#include <libpq-fe.h>

#include <utility>

#include "understory/util/error.h"

namespace understory {
namespace {

using ResultPtr = std::unique_ptr<PGresult, decltype(&PQclear)>;

// The server's words on one line.
std::string on_one_line(const char* message) {
  std::string text = message == nullptr ? "" : message;
  while (!text.empty() && (text.back() == '\n' || text.back() == ' '))
    text.pop_back();
  for (char& c : text)
    if (c == '\n' || c == '\t') c = ' ';
  return text;
}

// What the user gave, after what is usual here, so that the user's comes last and counts.
std::vector<std::pair<std::string, std::string>> parameters_of(const std::string& target) {
  std::vector<std::pair<std::string, std::string>> result = {
      {"application_name", "understory"}, {"connect_timeout", "10"}, {"keepalives_idle", "10"},
      {"keepalives_interval", "5"},       {"keepalives_count", "3"}, {"tcp_user_timeout", "30000"}};
  char* complaint = nullptr;
  PQconninfoOption* options = PQconninfoParse(target.c_str(), &complaint);
  if (options == nullptr) {
    std::string said = on_one_line(complaint);
    PQfreemem(complaint);
    throw ConfigError({"--to: expected PG:host=... dbname=..., or PG:postgresql://...; " + said});
  }
  for (const PQconninfoOption* each = options; each->keyword != nullptr; ++each)
    if (each->val != nullptr) result.emplace_back(each->keyword, each->val);
  PQconninfoFree(options);
  return result;
}

PGconn* connect(const std::string& target) {
  const auto parameters = parameters_of(target);
  std::vector<const char*> names;
  std::vector<const char*> values;
  for (const auto& [name, value] : parameters) {
    names.push_back(name.c_str());
    values.push_back(value.c_str());
  }
  names.push_back(nullptr);
  values.push_back(nullptr);
  return PQconnectdbParams(names.data(), values.data(), 0);
}

}  // namespace

struct PgConnection::Impl {
  std::unique_ptr<PGconn, decltype(&PQfinish)> connection{nullptr, &PQfinish};

  [[nodiscard]] ResultPtr execute(const std::string& sql) const {
    return {PQexec(connection.get(), sql.c_str()), &PQclear};
  }
};

PgConnection::PgConnection(const std::string& target) : impl_(std::make_unique<Impl>()) {
  impl_->connection.reset(connect(target));
  PGconn* connection = impl_->connection.get();
  const auto text = [](const char* given) { return std::string(given == nullptr ? "" : given); };
  name_ = "database " + text(PQdb(connection)) + " at " + text(PQhost(connection)) + ":" +
          text(PQport(connection));
  if (PQstatus(connection) != CONNECTION_OK)
    throw OutputError(name_, "no connection: " + on_one_line(PQerrorMessage(connection)));
  PQsetNoticeProcessor(
      connection, [](void*, const char*) {}, nullptr);
  PQsetClientEncoding(connection, "UTF8");
  run("BEGIN");
}

PgConnection::~PgConnection() = default;

void PgConnection::fail(const std::string& what) const {
  const std::string said = on_one_line(PQerrorMessage(impl_->connection.get()));
  const bool lost = PQstatus(impl_->connection.get()) != CONNECTION_OK;
  throw OutputError(name_, (lost ? "the connection was lost " : "the server refused ") + what +
                               ": " + said + "; nothing was written");
}

void PgConnection::run(const std::string& sql) {
  const ResultPtr result = impl_->execute(sql);
  const ExecStatusType status = PQresultStatus(result.get());
  if (status != PGRES_COMMAND_OK && status != PGRES_TUPLES_OK) fail("at " + sql.substr(0, 60));
}

std::size_t PgConnection::count_changed(const std::string& sql) {
  const ResultPtr result = impl_->execute(sql);
  if (PQresultStatus(result.get()) != PGRES_COMMAND_OK) fail("at " + sql.substr(0, 60));
  const std::string count = PQcmdTuples(result.get());
  return count.empty() ? 0 : std::stoul(count);
}

std::string PgConnection::value_of(const std::string& sql) {
  const ResultPtr result = impl_->execute(sql);
  if (PQresultStatus(result.get()) != PGRES_TUPLES_OK) fail("at " + sql.substr(0, 60));
  return PQntuples(result.get()) == 0 ? std::string() : PQgetvalue(result.get(), 0, 0);
}

std::string PgConnection::literal(const std::string& text) const {
  const std::unique_ptr<char, decltype(&PQfreemem)> quoted(
      PQescapeLiteral(impl_->connection.get(), text.c_str(), text.size()), &PQfreemem);
  if (!quoted) fail("at quoting a text");
  return quoted.get();
}

std::string PgConnection::identifier(const std::string& name) {
  std::string quoted = "\"";
  for (const char c : name) {
    if (c == '"') quoted += '"';
    quoted += c;
  }
  return quoted + "\"";
}

void PgConnection::copy(const std::string& sql, const std::function<std::string()>& next) {
  PGconn* connection = impl_->connection.get();
  const ResultPtr begun = impl_->execute(sql);
  if (PQresultStatus(begun.get()) != PGRES_COPY_IN) fail("at " + sql.substr(0, 60));
  for (std::string line = next(); !line.empty(); line = next())
    if (PQputCopyData(connection, line.data(), static_cast<int>(line.size())) != 1)
      fail("while rows were sent");
  if (PQputCopyEnd(connection, nullptr) != 1) fail("while rows were sent");
  const ResultPtr ended(PQgetResult(connection), &PQclear);
  if (PQresultStatus(ended.get()) != PGRES_COMMAND_OK) fail("while rows were sent");
  while (PGresult* rest = PQgetResult(connection))
    PQclear(rest);
}

void PgConnection::commit() {
  const ResultPtr result = impl_->execute("COMMIT");
  if (PQresultStatus(result.get()) == PGRES_COMMAND_OK) return;
  if (PQstatus(impl_->connection.get()) == CONNECTION_OK) fail("at COMMIT");
  throw OutputError(name_,
                    "the connection was lost while the transaction ended. The database holds the "
                    "whole run or nothing of it. Run the same command again: it replaces its rows");
}

std::string copy_field(const std::string& text) {
  std::string field;
  for (const char c : text) {
    if (c == '\\') {
      field += "\\\\";
    } else if (c == '\t') {
      field += "\\t";
    } else if (c == '\n') {
      field += "\\n";
    } else if (c == '\r') {
      field += "\\r";
    } else {
      field += c;
    }
  }
  return field;
}

}  // namespace understory
