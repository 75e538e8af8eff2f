# Bootstrap by sensor (boot) and mixed model (lme4). Tables in, tables out.

# Pearson's r from sums over centred records: n, x, y, xx, yy, xy.
pearson_from_sums <- function(s) {
  xx <- s[["xx"]] - s[["x"]]^2 / s[["n"]]
  yy <- s[["yy"]] - s[["y"]]^2 / s[["n"]]
  xy <- s[["xy"]] - s[["x"]] * s[["y"]] / s[["n"]]
  tiny <- 1e-12
  if (xx <= tiny * s[["xx"]] || yy <= tiny * s[["yy"]]) return(NaN)
  max(-1, min(1, xy / sqrt(xx * yy)))
}

# Draw sensors with replacement; each brings all of its records, that is, its row of sums.
bootstrap_by_sensor <- function(sums, replicates, confidence, seed) {
  RNGkind("Mersenne-Twister", "Inversion", "Rejection")
  set.seed(seed)
  sums <- as.matrix(sums)
  statistic <- function(data, rows) pearson_from_sums(colSums(data[rows, , drop = FALSE]))
  boots <- boot::boot(sums, statistic, R = replicates)
  empty <- function(note) data.frame(low = NaN, high = NaN, note = note)
  usable <- sum(is.finite(boots$t))
  if (usable < 0.95 * replicates)
    return(empty(sprintf("r is undefined in %d of %d replicates", replicates - usable, replicates)))
  if (diff(range(boots$t, na.rm = TRUE)) < 1e-12)
    return(data.frame(low = boots$t0, high = boots$t0, note = "every replicate gives the same r"))
  limits <- boot::boot.ci(boots, conf = confidence, type = "perc")$percent
  data.frame(low = limits[4], high = limits[5], note = "")
}

# measured ~ simulated + (1 | sensor), by restricted maximum likelihood.
# Both variables are scaled for the optimiser and scaled back in the table.
mixed_model <- function(records) {
  centre <- mean(records$simulated)
  unit_x <- sd(records$simulated)
  unit_y <- sd(records$measured)
  scaled <- data.frame(
    x = (records$simulated - centre) / unit_x,
    y = records$measured / unit_y,
    sensor = factor(records$sensor)
  )
  notes <- character()
  model <- withCallingHandlers(
    lme4::lmer(y ~ x + (1 | sensor), data = scaled, REML = TRUE),
    warning = function(w) {
      notes <<- c(notes, conditionMessage(w))
      invokeRestart("muffleWarning")
    },
    message = function(m) invokeRestart("muffleMessage") # singularity has a column of its own
  )
  beta <- lme4::fixef(model)
  covariance <- as.matrix(vcov(model))
  # (intercept, slope) in the records' units is a linear map of the scaled pair.
  back <- rbind(c(unit_y, -centre * unit_y / unit_x), c(0, unit_y / unit_x))
  fixed <- as.vector(back %*% beta)
  error <- sqrt(diag(back %*% covariance %*% t(back)))
  spread <- as.data.frame(lme4::VarCorr(model))$vcov
  explained <- var(beta[["x"]] * scaled$x)
  total <- explained + sum(spread)
  data.frame(
    intercept = fixed[1], intercept_se = error[1], slope = fixed[2], slope_se = error[2],
    sensor_sd = sqrt(spread[1]) * unit_y, residual_sd = sqrt(spread[2]) * unit_y,
    r2_marginal = explained / total, r2_conditional = (explained + spread[1]) / total,
    residual_autocorrelation = autocorrelation(residuals(model), scaled$sensor),
    singular = lme4::isSingular(model),
    note = gsub("\\s+", " ", paste(notes, collapse = "; "))
  )
}

# Correlation of a residual with the next one of the same sensor, pooled over sensors.
autocorrelation <- function(residual, sensor) {
  parts <- split(residual - mean(residual), sensor)
  products <- sum(sapply(parts, function(e) sum(e[-1] * e[-length(e)])))
  squares <- sum(sapply(parts, function(e) sum(e[-length(e)]^2)))
  if (squares > 0) products / squares else NaN
}
