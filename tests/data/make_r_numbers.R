# Makes the numbers that tests of the analysis compare with; R is never needed to run the tests.
# Usage: PACE_SHARED=... Rscript tests/data/make_r_numbers.R   (Debian: r-base-core r-cran-lme4
# r-cran-glmmtmb r-cran-sandwich r-cran-jsonlite). Writes tests/data/analysis/.
library(lme4); library(glmmTMB); library(sandwich); library(jsonlite)
folder <- "tests/data/analysis"
tight <- glmerControl(tolPwrss = 1e-12, optimizer = "bobyqa",
                      optCtrl = list(rhobeg = .2, rhoend = 1e-7))

# A small simulated study: 24 participants, 16 clips in 4 scenes, some answers missing, a side effect.
set.seed(20260101)
d <- expand.grid(participant = 1:24, stimulus = 1:16)
d$scene <- (d$stimulus - 1) %/% 4 + 1
d$first <- rbinom(nrow(d), 1, .5)
eta <- .5 + .3 * (d$first - .5) + rnorm(24, 0, .7)[d$participant] + rnorm(16, 0, .6)[d$stimulus]
d$won <- rbinom(nrow(d), 1, plogis(eta))
d <- d[runif(nrow(d)) < .85, ]
write.csv(d, file.path(folder, "crossed.csv"), row.names = FALSE)

mixed <- function(fit) list(
  beta = unname(fixef(fit)), se = unname(sqrt(diag(as.matrix(vcov(fit))))),
  variance = lapply(VarCorr(fit), function(v) v[1]), log_likelihood = as.numeric(logLik(fit)))

out <- list(made_with = list(
  R = R.version.string, lme4 = as.character(packageVersion("lme4")),
  glmmTMB = as.character(packageVersion("glmmTMB")),
  sandwich = as.character(packageVersion("sandwich"))))
d$side <- d$first - .5
out$crossed <- list(
  intercept = mixed(glmer(won ~ 1 + (1 | participant) + (1 | stimulus), d, binomial, control = tight)),
  side = mixed(glmer(won ~ side + (1 | participant) + (1 | stimulus), d, binomial, control = tight)))
flat <- glm(won ~ 1, binomial, d)
variance <- function(...) vcovCL(flat, type = "HC0", cadjust = TRUE, ...)[1]
out$clustered <- list(
  logit = unname(coef(flat)), participant = variance(cluster = ~participant),
  stimulus = variance(cluster = ~stimulus), two_way = variance(cluster = ~ participant + stimulus))
sided <- glm(won ~ side, binomial, d)
out$side <- list(beta = unname(coef(sided)),
  se_two_way = unname(sqrt(diag(vcovCL(sided, ~ participant + stimulus, type = "HC0", cadjust = TRUE)))))
scenes <- glm(won ~ factor(scene) - 1, binomial, d)
out$scenes <- list(logit = unname(coef(scenes)),
  vcov_participant = unname(vcovCL(scenes, ~participant, type = "HC0", cadjust = TRUE)))

# lme4 stops early at its default tolerance; the same models with tight tolerance and by glmmTMB.
shared <- Sys.getenv("PACE_SHARED")
if (nzchar(shared)) {
  tmo <- read.csv(file.path(shared, "data/analysis/pwcmp_tmo.csv"))
  for (m in sort(unique(c(tmo$condition_A, tmo$condition_B)))) {
    s <- tmo[tmo$condition_A == m | tmo$condition_B == m, ]
    s$side <- ifelse(s$condition_A == m, .5, -.5)
    s$won <- ifelse(s$condition_A == m, s$is_A_selected, 1 - s$is_A_selected)
    out$tmo[[m]] <- mixed(glmer(won ~ side + (1 | observer) + (1 | scene), s, binomial, control = tight))
  }
}
write(toJSON(out, digits = 12, auto_unbox = TRUE, pretty = TRUE), file.path(folder, "r_numbers.json"))
