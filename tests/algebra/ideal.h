// Computes with polynomial ideals of finitely many solutions over a prime field (M15, M16). They test the closed-form
// solvers of the program independently; the program does not contain them.
//
// Plain linear algebra replaces Buchberger's pairs. V_d is the smallest space of polynomials of degree <= d that
// contains the generators and, with every f of degree < d, also all x_i f. Its echelon form in degree reverse
// lexicographic order is built row by row; a row whose degree fell in the reduction is multiplied again. If no standard
// monomial (one that leads no row) has degree d - 1 or d, then the multiplication of the standard monomials is defined
// and commutes. They are then a basis of R / I, and the rows are a Groebner basis (Mourrain, "A new criterion for
// normal form algorithms", AAECC 1999).
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <map>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <vector>

namespace megablock::algebra {

// Numbers modulo the prime P < 2^62.
template <std::uint64_t P>
struct Modular {
  static std::uint64_t from(std::int64_t value) {
    const auto p = static_cast<std::int64_t>(P);
    return static_cast<std::uint64_t>((value % p + p) % p);
  }
  // The number of least absolute value.
  static std::int64_t lift(std::uint64_t value) {
    return value > P / 2 ? static_cast<std::int64_t>(value) - static_cast<std::int64_t>(P)
                         : static_cast<std::int64_t>(value);
  }
  static std::uint64_t add(std::uint64_t a, std::uint64_t b) { return (a + b) % P; }
  static std::uint64_t negative(std::uint64_t a) { return a == 0 ? 0 : P - a; }
  static std::uint64_t times(std::uint64_t a, std::uint64_t b) {
    return static_cast<std::uint64_t>(static_cast<unsigned __int128>(a) * b % P);
  }
  static std::uint64_t inverse(std::uint64_t a) {
    std::uint64_t result = 1;
    for (std::uint64_t power = P - 2; power > 0; power /= 2, a = times(a, a))
      if (power % 2 == 1) result = times(result, a);
    return result;
  }
};

using Monomial = std::vector<int>;  // exponents, first variable first
inline int degree(const Monomial& m) { return std::accumulate(m.begin(), m.end(), 0); }

// Degree reverse lexicographic, greatest first.
struct GreaterDegRevLex {
  bool operator()(const Monomial& a, const Monomial& b) const {
    if (degree(a) != degree(b)) return degree(a) > degree(b);
    for (std::size_t i = a.size(); i-- > 0;)
      if (a[i] != b[i]) return a[i] < b[i];
    return false;
  }
};

template <std::uint64_t P>
class Polynomial {
 public:
  using Field = Modular<P>;
  using Terms = std::map<Monomial, std::uint64_t, GreaterDegRevLex>;

  Polynomial() = default;
  static Polynomial constant(std::int64_t value, int variables) {
    Polynomial result;
    result.add(Monomial(static_cast<std::size_t>(variables), 0), Field::from(value));
    return result;
  }
  static Polynomial variable(int i, int variables) {
    Monomial m(static_cast<std::size_t>(variables), 0);
    m[static_cast<std::size_t>(i)] = 1;
    Polynomial result;
    result.add(m, 1);
    return result;
  }

  const Terms& terms() const { return terms_; }
  int degree() const { return terms_.empty() ? -1 : algebra::degree(terms_.begin()->first); }

  Polynomial operator+(const Polynomial& other) const {
    Polynomial result = *this;
    for (const auto& [m, c] : other.terms_) result.add(m, c);
    return result;
  }
  Polynomial operator-(const Polynomial& other) const { return *this + other * -1; }
  Polynomial operator*(const Polynomial& other) const {
    Polynomial result;
    for (const auto& [m, c] : terms_)
      for (const auto& [n, d] : other.terms_) {
        Monomial product = m;
        for (std::size_t i = 0; i < m.size(); ++i) product[i] += n[i];
        result.add(product, Field::times(c, d));
      }
    return result;
  }
  Polynomial operator*(std::int64_t factor) const {
    Polynomial result;
    for (const auto& [m, c] : terms_) result.add(m, Field::times(c, Field::from(factor)));
    return result;
  }

 private:
  void add(const Monomial& m, std::uint64_t c) {
    const auto found = terms_.try_emplace(m, 0).first;
    found->second = Field::add(found->second, c);
    if (found->second == 0) terms_.erase(found);
  }
  Terms terms_;
};

// All monomials up to a degree, greatest first.
inline std::vector<Monomial> monomials_up_to(int variables, int most) {
  std::vector<Monomial> all;
  Monomial m(static_cast<std::size_t>(variables), 0);
  const std::function<void(std::size_t, int)> fill = [&](std::size_t i, int left) {
    if (i == m.size()) {
      all.push_back(m);
      return;
    }
    for (m[i] = 0; m[i] <= left; ++m[i]) fill(i + 1, left - m[i]);
    m[i] = 0;
  };
  fill(0, most);
  std::sort(all.begin(), all.end(), GreaterDegRevLex());
  return all;
}

// Rows in echelon form, each led by a one, zero in front of it.
template <std::uint64_t P>
class Echelon {
 public:
  using Field = Modular<P>;
  using Row = std::vector<std::uint64_t>;
  static constexpr bool kSmall = P < (1 << 15);  // products may be summed before they are reduced

  explicit Echelon(std::size_t columns) : row_of_(columns) {}

  // Reduces by the rows that are there; the leading column, or none where nothing is left.
  std::optional<std::size_t> reduce(Row& row) const {
    std::optional<std::size_t> lead;
    for (std::size_t c = 0; c < row.size(); ++c) {
      if (row[c] == 0 || (row[c] %= P) == 0) continue;
      if (row_of_[c].empty()) {
        if (!lead) lead = c;
        continue;
      }
      const std::uint64_t factor = P - row[c];
      const std::uint32_t* narrow = nullptr;
      if constexpr (kSmall) {
        narrow = row_of_[c].narrow.data();
        std::uint64_t* target = row.data() + c;
        const std::size_t length = row.size() - c;
        for (std::size_t j = 0; j < length; ++j) target[j] += factor * narrow[j];
        row[c] = 0;
      } else {
        for (std::size_t j = c; j < row.size(); ++j)
          row[j] = Field::add(row[j], Field::times(factor, row_of_[c].wide[j - c]));
      }
    }
    return lead;
  }
  // A reduced row with its leading column.
  void insert(Row row, std::size_t lead) {
    const std::uint64_t scale = Field::inverse(row[lead]);
    Stored stored;
    for (std::size_t j = lead; j < row.size(); ++j) {
      const std::uint64_t value = Field::times(row[j], scale);
      if constexpr (kSmall)
        stored.narrow.push_back(static_cast<std::uint32_t>(value));
      else
        stored.wide.push_back(value);
    }
    row_of_[lead] = std::move(stored);
  }
  bool leads(std::size_t column) const { return !row_of_[column].empty(); }
  std::size_t rank() const {
    return static_cast<std::size_t>(
        std::count_if(row_of_.begin(), row_of_.end(), [](const auto& r) { return !r.empty(); }));
  }

 private:
  struct Stored {  // from the leading column on
    std::vector<std::uint32_t> narrow;
    std::vector<std::uint64_t> wide;
    bool empty() const { return narrow.empty() && wide.empty(); }
  };
  std::vector<Stored> row_of_;  // [columns] the row that this column leads
};

template <std::uint64_t P>
class Ideal {
 public:
  using Field = Modular<P>;
  using Row = std::vector<std::uint64_t>;

  // Throws std::runtime_error where there are infinitely many solutions, or the degree is not enough.
  Ideal(const std::vector<Polynomial<P>>& generators, int variables, int most_degree = 12) : variables_(variables) {
    int first = 0;
    for (const auto& f : generators) first = std::max(first, f.degree());
    for (degree_ = first; degree_ <= most_degree; ++degree_)
      if (close(generators)) return;
    throw std::runtime_error("no finite basis up to the largest degree");
  }

  int degree() const { return degree_; }  // that was needed
  // Basis of R / I, least first.
  const std::vector<Monomial>& standard() const { return standard_; }

  // Multiplication by a variable in that basis: column j holds x_i times the j-th standard monomial.
  std::vector<Row> multiplication(int variable) const {
    std::vector<Row> matrix(standard_.size(), Row(standard_.size(), 0));
    for (std::size_t j = 0; j < standard_.size(); ++j) {
      Monomial product = standard_[j];
      ++product[static_cast<std::size_t>(variable)];
      Row row(monomials_.size(), 0);
      row[column_.at(product)] = 1;
      echelon_->reduce(row);
      for (std::size_t i = 0; i < standard_.size(); ++i) matrix[i][j] = row[column_.at(standard_[i])];
    }
    return matrix;
  }

  // Monomials that lead a row and of which no divisor does: those of the reduced Groebner basis.
  std::vector<Monomial> leading() const {
    std::vector<Monomial> result;
    for (std::size_t c = 0; c < monomials_.size(); ++c) {
      if (!echelon_->leads(c)) continue;
      bool least = true;
      for (std::size_t i = 0; i < monomials_[c].size() && least; ++i) {
        if (monomials_[c][i] == 0) continue;
        Monomial divisor = monomials_[c];
        --divisor[i];
        least = !echelon_->leads(column_.at(divisor));
      }
      if (least) result.push_back(monomials_[c]);
    }
    return result;
  }

 private:
  bool close(const std::vector<Polynomial<P>>& generators) {
    monomials_ = monomials_up_to(variables_, degree_);
    column_.clear();
    for (std::size_t c = 0; c < monomials_.size(); ++c) column_[monomials_[c]] = c;
    std::vector<std::vector<std::uint32_t>> shifted(static_cast<std::size_t>(variables_));
    for (std::size_t i = 0; i < shifted.size(); ++i)
      for (Monomial m : monomials_) {
        ++m[i];
        const auto found = column_.find(m);
        shifted[i].push_back(found == column_.end() ? 0 : static_cast<std::uint32_t>(found->second));
      }
    echelon_.emplace(monomials_.size());
    // Rows of low degree first: their multiples reduce the others.
    std::map<int, std::vector<Row>> open;
    const auto take = [&](Row row) {
      const auto lead = echelon_->reduce(row);
      if (!lead) return;
      echelon_->insert(row, *lead);
      open[algebra::degree(monomials_[*lead])].push_back(std::move(row));
    };
    for (const auto& f : generators) {
      Row row(monomials_.size(), 0);
      for (const auto& [m, c] : f.terms()) row[column_.at(m)] = c;
      take(std::move(row));
    }
    while (!open.empty() && open.begin()->first < degree_) {
      const auto lowest = open.begin();
      const Row row = std::move(lowest->second.back());
      lowest->second.pop_back();
      if (lowest->second.empty()) open.erase(lowest);
      for (const auto& shift : shifted) {
        Row product(row.size(), 0);
        for (std::size_t c = 0; c < row.size(); ++c)
          if (row[c] != 0) product[shift[c]] = row[c];
        take(std::move(product));
      }
    }
    standard_.clear();
    int highest = -1;
    for (std::size_t c = monomials_.size(); c-- > 0;)
      if (!echelon_->leads(c)) {
        standard_.push_back(monomials_[c]);
        highest = std::max(highest, algebra::degree(monomials_[c]));
      }
    return highest <= degree_ - 2;
  }

  int variables_ = 0, degree_ = 0;
  std::vector<Monomial> monomials_, standard_;
  std::map<Monomial, std::size_t> column_;
  std::optional<Echelon<P>> echelon_;
};

}  // namespace megablock::algebra
