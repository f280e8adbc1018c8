// Makes the elimination template of a polynomial system (M18), once per kind of problem. The template names products of
// the equations. If they are eliminated like linear equations in their monomials, they give a Groebner basis for any
// coefficients.
//
// All products up to a degree are taken, the lowest degree that is sufficient. Then the products are tried one by one,
// the highest first: a product is removed if the others still give every leading monomial of the basis.
#pragma once

#include "tests/algebra/ideal.h"

namespace megablock::algebra {

struct TemplateRow {
  Monomial multiplier;
  std::size_t equation;
};
struct EliminationTemplate {
  std::vector<TemplateRow> rows;
  std::vector<Monomial> columns;  // greatest first
};

// Products of one system's equations in the monomials up to a degree.
template <std::uint64_t P>
class Products {
 public:
  using Row = std::vector<std::uint64_t>;

  Products(const std::vector<Polynomial<P>>& equations, const std::vector<TemplateRow>& rows, int variables, int most)
      : monomials_(monomials_up_to(variables, most)) {
    for (std::size_t c = 0; c < monomials_.size(); ++c) column_[monomials_[c]] = c;
    for (const TemplateRow& row : rows) {
      rows_.emplace_back(monomials_.size(), 0);
      for (const auto& [m, c] : equations[row.equation].terms()) {
        Monomial product = m;
        for (std::size_t i = 0; i < m.size(); ++i) product[i] += row.multiplier[i];
        rows_.back()[column_.at(product)] = c;
      }
    }
  }

  // Whether these rows, eliminated, give all these leading monomials.
  bool eliminate(const std::vector<std::size_t>& rows, const std::vector<Monomial>& leading) const {
    Echelon<P> echelon(monomials_.size());
    for (const std::size_t i : rows) {
      Row values = rows_[i];
      if (const auto lead = echelon.reduce(values)) echelon.insert(std::move(values), *lead);
    }
    return std::all_of(leading.begin(), leading.end(),
                       [&](const Monomial& m) { return column_.contains(m) && echelon.leads(column_.at(m)); });
  }
  // Rows that do not depend on those behind them.
  std::vector<std::size_t> independent() const {
    Echelon<P> echelon(monomials_.size());
    std::vector<std::size_t> result;
    for (std::size_t i = rows_.size(); i-- > 0;) {
      Row values = rows_[i];
      const auto lead = echelon.reduce(values);
      if (!lead) continue;
      echelon.insert(std::move(values), *lead);
      result.push_back(i);
    }
    std::reverse(result.begin(), result.end());
    return result;
  }
  std::vector<Monomial> columns(const std::vector<std::size_t>& rows) const {
    std::vector<Monomial> result;
    for (std::size_t c = 0; c < monomials_.size(); ++c)
      if (std::any_of(rows.begin(), rows.end(), [&](std::size_t i) { return rows_[i][c] != 0; }))
        result.push_back(monomials_[c]);
    return result;
  }

 private:
  std::vector<Monomial> monomials_;
  std::map<Monomial, std::size_t> column_;
  std::vector<Row> rows_;
};

inline int degree(const EliminationTemplate& made) { return made.columns.empty() ? 0 : degree(made.columns.front()); }

// Whether a template serves another system of its kind.
template <std::uint64_t P>
bool eliminates(const EliminationTemplate& made, const std::vector<Polynomial<P>>& equations,
                const std::vector<Monomial>& leading) {
  const int variables = static_cast<int>(leading.front().size());
  std::vector<std::size_t> all(made.rows.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return Products<P>(equations, made.rows, variables, degree(made)).eliminate(all, leading);
}

// Empty where no degree up to `most_degree` is enough.
template <std::uint64_t P>
EliminationTemplate make_template(const std::vector<Polynomial<P>>& equations, const Ideal<P>& ideal, int variables,
                                  int most_degree = 9) {
  const std::vector<Monomial> leading = ideal.leading();
  for (int most = ideal.degree(); most <= most_degree; ++most) {
    std::vector<TemplateRow> rows;
    for (std::size_t e = 0; e < equations.size(); ++e)
      for (const Monomial& m : monomials_up_to(variables, most - equations[e].degree())) rows.push_back({m, e});
    std::stable_sort(rows.begin(), rows.end(), [](const TemplateRow& a, const TemplateRow& b) {
      return GreaterDegRevLex()(a.multiplier, b.multiplier);
    });
    const Products<P> products(equations, rows, variables, most);
    std::vector<std::size_t> kept = products.independent();
    if (!products.eliminate(kept, leading)) continue;
    for (std::size_t i = 0; i < kept.size();) {
      std::vector<std::size_t> fewer = kept;
      fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(i));
      if (products.eliminate(fewer, leading))
        kept = std::move(fewer);
      else
        ++i;
    }
    EliminationTemplate result{{}, products.columns(kept)};
    for (const std::size_t i : kept) result.rows.push_back(rows[i]);
    return result;
  }
  return {};
}

}  // namespace megablock::algebra
