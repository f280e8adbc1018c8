// Makes the text and the page of a comparison of camera models.
#include <fmt/core.h>

#include "adjust/calibration/model_comparison.h"
#include "io/report/drawing/drawing.h"
#include "io/report/drawing/html.h"
#include "io/report/drawing/page.h"

namespace megablock {

namespace {

std::string probability_text(double probability) {
  return probability < 1e-99  ? "0"
         : probability < 1e-3 ? fmt::format("{:.0e}", probability)
                              : fmt::format("{:.3f}", probability);
}

std::string recommendation(const ModelComparison& comparison, std::size_t camera) {
  const int best = comparison.recommended[camera];
  if (best < 0) return "no model could be adjusted";
  const ModelTrial& trial = comparison.trials[static_cast<std::size_t>(best)];
  const ResidualStructure& s = trial.cameras[camera].structure;
  if (comparison.without_structure[camera])
    return fmt::format("recommended: {} ({} parameters), the smallest model whose residuals have no structure",
                       trial.candidate.name, trial.candidate.parameters());
  return fmt::format(
      "every model leaves structure; least with {} ({} parameters, {:.3f} px of {:.3f} px), the smallest within a "
      "tenth "
      "of it",
      trial.candidate.name, trial.candidate.parameters(), s.structure_px, trial.cameras[camera].rms_px);
}

}  // namespace

std::string comparison_table(const ModelComparison& comparison, std::size_t camera) {
  std::string text = fmt::format("  {:<18}{:>11}{:>10}{:>10}{:>9}{:>16}{:>10}{:>15}\n", "model", "parameters", "RMS px",
                                 "sigma px", "dof", "T / dof", "p", "structure px");
  for (std::size_t t = 0; t < comparison.trials.size(); ++t) {
    const ModelTrial& trial = comparison.trials[t];
    text += fmt::format("{} {:<18}{:>11}", static_cast<int>(t) == comparison.recommended[camera] ? '>' : ' ',
                        trial.candidate.name, trial.candidate.parameters());
    if (!trial.failure.empty()) {
      text += "  " + trial.failure + "\n";
      continue;
    }
    const ModelFigures& f = trial.cameras[camera];
    text += fmt::format("{:>10.3f}{:>10.3f}{:>9}{:>16}{:>10}{:>15.3f}\n", f.rms_px, trial.sigma_px,
                        trial.degrees_of_freedom,
                        fmt::format("{:.0f} / {:.0f}", f.structure.statistic, f.structure.degrees),
                        probability_text(f.structure.probability), f.structure.structure_px);
  }
  return text + recommendation(comparison, camera) + "\n";
}

std::string comparison_page(const ModelComparison& comparison, const Block& block, const std::string& source) {
  using namespace report;
  std::string body = section(
      "data", "Data",
      paragraph(fmt::format("{} frames, {} images, {} points, {} measurements; the same ones for every model, without "
                            "robust weights.",
                            comparison.frames, comparison.images, count(comparison.points),
                            count(comparison.observations))) +
          paragraph(fmt::format(
              "T is chi-square distributed when the residuals over the sensor are noise; p below {} is taken for "
              "structure. The smallest model without structure is recommended, not the one with the lowest RMS.",
              comparison.probability)));
  for (std::size_t c = 0; c < comparison.cameras.size(); ++c) {
    const Camera& camera = block.cameras[comparison.cameras[c]];
    Table table(
        {"model", "parameters", "RMS [px]", "sigma [px]", "degrees of freedom", "T", "of", "p", "structure [px]"});
    std::string fields;
    for (std::size_t t = 0; t < comparison.trials.size(); ++t) {
      const ModelTrial& trial = comparison.trials[t];
      const bool chosen = static_cast<int>(t) == comparison.recommended[c];
      if (!trial.failure.empty()) {
        table.add({escape(trial.candidate.name), std::to_string(trial.candidate.parameters()), escape(trial.failure)});
        continue;
      }
      const ModelFigures& f = trial.cameras[c];
      table.add({escape(trial.candidate.name), std::to_string(trial.candidate.parameters()), fixed(f.rms_px, 3),
                 fixed(trial.sigma_px, 3), count(trial.degrees_of_freedom), fixed(f.structure.statistic, 0),
                 fixed(f.structure.degrees, 0), probability_text(f.structure.probability),
                 fixed(f.structure.structure_px, 3)},
                chosen ? "sum" : "");
      const FieldDrawing drawing = draw(f.structure.field, camera);
      fields += figure(drawing.svg, "<b>" + escape(trial.candidate.name) + "</b>" + (chosen ? " (recommended)" : "") +
                                        ": RMS " + fixed(f.rms_px, 3) + " px. " + drawing.caption);
    }
    body += section("camera" + std::to_string(c), escape(camera.name),
                    paragraph(escape(recommendation(comparison, c))) + table.html() +
                        "<h3>Residuals over the sensor</h3>" + "<div class=row>" + fields + "</div>");
  }
  return page("Camera models compared", escape(source), body, "{}");
}

}  // namespace megablock
