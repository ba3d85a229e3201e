//! Published examples of each formula, and what must hold for all values.

use proptest::prelude::*;

use super::distribution::{Z_95, binomial_at_least, normal_two_sided, student_quantile, student_two_sided};
use super::effect::{cliffs_delta, cohens_d, d_z, hedges_g};
use super::*;

/// That they agree to the last digit of `expected` as it was printed.
#[track_caller]
fn near(got: impl Into<Option<f64>>, expected: f64, tolerance: f64) {
    let got = got.into().expect("there is a result");
    assert!((got - expected).abs() <= tolerance, "got {got}, expected {expected}");
}

// ---------------------------------------------------------------------------------------------
// Published examples

/// Hours of sleep gained with two drugs (Student 1908), `sleep` of R.
const SLEEP: [[f64; 10]; 2] = [
    [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0],
    [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4],
];

/// Hamilton depression scale factors before and after (Hollander and Wolfe 1973, table 3.1), in the help of R's `wilcox.test`.
#[expect(clippy::approx_constant, reason = "a measured 3.14")]
const DEPRESSION: [[f64; 9]; 2] = [
    [1.83, 0.50, 1.62, 2.48, 1.68, 1.88, 1.55, 3.06, 1.30],
    [0.878, 0.647, 0.598, 2.05, 1.06, 1.29, 1.06, 3.14, 1.29],
];

#[test]
fn paired_t_test_of_students_sleep() {
    // R: t.test(extra ~ group, data = sleep, paired = TRUE)
    let test = paired_t(&SLEEP[0], &SLEEP[1]).expect("it can be tested");
    near(test.t, -4.0621, 5e-5);
    near(test.degrees, 9.0, 0.0);
    near(test.p, 0.002833, 5e-7);
    near(test.difference, -1.58, 1e-12);
    near(test.low, -2.4598858, 5e-8);
    near(test.high, -0.7001142, 5e-8);
}

#[test]
fn welch_test_of_students_sleep() {
    // R: t.test(extra ~ group, data = sleep)
    let test = welch_t(&SLEEP[0], &SLEEP[1]).expect("it can be tested");
    near(test.t, -1.8608, 5e-5);
    near(test.degrees, 17.776, 5e-4);
    near(test.p, 0.07939, 5e-6);
    near(test.low, -3.3654832, 5e-8);
    near(test.high, 0.2054832, 5e-8);
}

#[test]
fn wilcoxon_test_of_depression() {
    // Hollander and Wolfe 1973, p. 29: V = 40, one-sided 0.01953.
    let test = wilcoxon(&DEPRESSION[0], &DEPRESSION[1]).expect("it can be tested");
    assert_eq!((test.n, test.v, test.exact), (9, 40.0, true));
    near(test.p, 0.0390625, 1e-12);
}

#[test]
fn wilcoxon_test_with_many_ties() {
    // scipy 1.17: wilcoxon(d, correction=True, method="approx") with d without its two zeros
    let differences: Vec<f64> = (0..60).map(|i| f64::from((i * 37) % 23 - 9) / 2.0).collect();
    let test = wilcoxon(&differences, &[0.0; 60]).expect("it can be tested");
    assert_eq!((test.n, test.exact), (58, false));
    near(test.p, 0.043_936_679_795_838_33, 1e-12);
}

#[test]
fn quantiles_of_type_7() {
    // R: quantile(1:10); quantile(c(1, 2, 4, 8), 0.4)
    let values: Vec<f64> = (1..=10).map(f64::from).collect();
    for (p, expected) in [(0.0, 1.0), (0.25, 3.25), (0.5, 5.5), (0.75, 7.75), (1.0, 10.0)] {
        near(quantile(&values, p), expected, 1e-15);
    }
    near(quantile(&[8.0, 1.0, 4.0, 2.0], 0.4), 2.4, 1e-15);
}

#[test]
fn students_table() {
    // Any table of Student's t: 0.975 and 0.995.
    for (degrees, at_975, at_995) in [
        (1.0, 12.706, 63.657),
        (2.0, 4.303, 9.925),
        (9.0, 2.262, 3.250),
        (30.0, 2.042, 2.750),
        (120.0, 1.980, 2.617),
    ] {
        near(student_quantile(0.975, degrees), at_975, 5e-4);
        near(student_quantile(0.995, degrees), at_995, 5e-4);
        near(student_quantile(0.025, degrees), -at_975, 5e-4);
    }
    near(student_quantile(0.975, 1e15), Z_95, 1e-9);
    near(student_two_sided(2.5, 1e6), student_two_sided(2.5, 1e6 + 1.0).expect("there is one"), 1e-6);
    assert_eq!(student_quantile(0.5, 3.0), Some(0.0));
}

#[test]
fn interval_of_the_median_as_in_the_tables() {
    // Ranks for the sign test, as in Conover 1999, table A3: n = 6: 1 and 6; n = 10: 2 and 9; n = 20: 6 and 15; n = 25: 8 and 18.
    for (n, low, high) in [(6, 1.0, 6.0), (10, 2.0, 9.0), (20, 6.0, 15.0), (25, 8.0, 18.0)] {
        let values: Vec<f64> = (1..=n).rev().map(f64::from).collect();
        assert_eq!(median_interval(&values), Some(Interval { low, high }), "of {n}");
    }
    assert_eq!(median_interval(&[1.0, 2.0, 3.0, 4.0, 5.0]), None);
}

#[test]
fn wilson_as_in_newcombe() {
    // Newcombe 1998, Statistics in Medicine 17, 857–872, table I, method 3.
    for (k, n, low, high) in
        [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)]
    {
        let interval = wilson(k, n).expect("there are trials");
        near(interval.low, low, 5e-5);
        near(interval.high, high, 5e-5);
    }
}

#[test]
fn differences_of_rates_as_in_newcombe() {
    // Newcombe 1998, Statistics in Medicine 17, 873–890, table II, method 10.
    for (k, m, l, n, low, high) in [
        (56, 70, 48, 80, 0.0524, 0.3339),
        (9, 10, 3, 10, 0.1705, 0.8090),
        (6, 7, 2, 7, 0.0582, 0.8062),
        (5, 56, 0, 29, -0.0381, 0.1926),
        (0, 10, 0, 20, -0.1611, 0.2775),
        (0, 10, 0, 10, -0.2775, 0.2775),
        (10, 10, 0, 20, 0.6791, 1.0),
        (10, 10, 0, 10, 0.6075, 1.0),
    ] {
        let found = newcombe(k, m, l, n).expect("there are trials");
        near(found.difference, k as f64 / m as f64 - l as f64 / n as f64, 1e-15);
        near(found.low, low, 5e-5);
        near(found.high, high, 5e-5);
    }
}

#[test]
fn differences_of_paired_rates() {
    // Airway hyper-responsiveness (Bentur et al. 2009) in Fagerland, Lydersen and Laake 2017, chapter 8: −0.507 to −0.026.
    let found = newcombe_paired(1, 1, 7, 12).expect("there are pairs");
    near(found.difference, -6.0 / 21.0, 1e-12);
    near(found.low, -0.507, 5e-4);
    near(found.high, -0.026, 5e-4);
}

#[test]
fn fisher_of_the_lady_tasting_tea() {
    // Agresti 2002, table 3.8: 0.486; R prints 0.4857. It is 34 / 70.
    near(fisher(3, 1, 1, 3), 34.0 / 70.0, 1e-14);
    // Convictions of twins (Fisher 1935), in the help of R's fisher.test: p-value = 0.0005367.
    near(fisher(10, 2, 3, 15), 0.0005367, 5e-8);
    // The table of scipy's own test and of statrs.
    near(fisher(3, 5, 4, 50), 0.039_707_492_465_292_76, 1e-14);
}

#[test]
fn mcnemar_of_approval_ratings() {
    // Agresti 2002, table 10.1: 150 and 86 changed their mind. R: binom.test(86, 236)$p.value
    near(mcnemar(150, 86), 3.715_936_139_571e-5, 1e-14);
    // 2 of 12: 2 · (1 + 12 + 66) / 4096.
    near(mcnemar(2, 10), 158.0 / 4096.0, 2e-11);
}

#[test]
fn holm_by_hand() {
    // R: p.adjust(c(0.01, 0.02, 0.03, 0.04, 0.05), "holm") is 0.05 0.08 0.09 0.09 0.09
    let corrected = holm(&[0.04, 0.01, 0.03, 0.02, 0.05]).expect("they are probabilities");
    for (got, expected) in corrected.iter().zip([0.09, 0.05, 0.09, 0.08, 0.09]) {
        near(*got, expected, 1e-15);
    }
    assert_eq!(holm(&[0.6, 0.9]), Some(vec![1.0, 1.0]));
    assert_eq!(holm(&[]), Some(vec![]));
}

#[test]
fn effect_sizes_of_students_sleep() {
    // From the moments of the data as R prints them: means 0.75 and 2.33, deviations 1.789010 and 2.002249, those of the
    // differences 1.229995.
    near(
        cohens_d(&SLEEP[0], &SLEEP[1]),
        -1.58 / ((1.789010f64.powi(2) + 2.002249f64.powi(2)) / 2.0).sqrt(),
        1e-6,
    );
    near(d_z(&SLEEP[0], &SLEEP[1]), -1.58 / 1.229995, 1e-6);
    // The factor for 18 degrees of freedom: 0.9576 (Hedges 1981, table 2).
    let bias = hedges_g(&SLEEP[0], &SLEEP[1]).expect("it scatters")
        / cohens_d(&SLEEP[0], &SLEEP[1]).expect("it scatters");
    near(bias, 0.9576, 5e-5);
    near(cliffs_delta(&SLEEP[0], &SLEEP[1]), -0.49, 1e-15);
}

// ---------------------------------------------------------------------------------------------
// Nothing to say

#[test]
fn what_does_not_scatter() {
    let same = [0.1, 0.1, 0.1];
    let test = paired_t(&same, &same).expect("there are pairs");
    assert_eq!((test.p, test.t, test.low, test.high), (1.0, 0.0, 0.0, 0.0));
    for test in [paired_t(&[1.1, 2.1, 3.1], &[1.0, 2.0, 3.0]), welch_t(&[2.0, 2.0], &[5.0, 5.0, 5.0])] {
        let test = test.expect("there are values");
        assert_eq!(test.p, 0.0);
        assert_eq!((test.low, test.high), (test.difference, test.difference));
    }
    assert_eq!(welch_t(&same, &same).map(|test| (test.p, test.degrees)), Some((1.0, 4.0)));
    assert_eq!(wilcoxon(&same, &same).map(|test| (test.n, test.p)), Some((0, 1.0)));
    assert_eq!(Summary::of(&same).and_then(|summary| summary.sd), Some(0.0));
    assert_eq!((cohens_d(&same, &same), cohens_d(&same, &[1.0, 1.0])), (Some(0.0), None));
}

#[test]
fn too_few_and_not_finite() {
    let one = Summary::of(&[7.0]).expect("there is a value");
    assert_eq!((one.n, one.mean, one.q1, one.sd, one.low), (1, 7.0, 7.0, None, None));
    for values in [&[][..], &[1.0, f64::NAN], &[f64::INFINITY, 0.0]] {
        assert_eq!(Summary::of(values), None);
        assert_eq!((mean(values), median(values), sd(values)), (None, None, None));
        assert_eq!(median_interval(values), None);
        assert_eq!((paired_t(values, values), welch_t(values, values)), (None, None));
        assert_eq!(wilcoxon(values, values), None);
        assert_eq!((cohens_d(values, values), d_z(values, values)), (None, None));
        assert_eq!((hedges_g(values, values), cliffs_delta(values, values)), (None, None));
    }
    assert_eq!((paired_t(&[1.0], &[2.0]), paired_t(&[1.0, 2.0], &[1.0])), (None, None));
    assert_eq!((Summary::of(&[f64::MAX, -f64::MAX]), holm(&[f64::NAN])), (None, None));
    assert_eq!((wilson(0, 0), wilson(2, 1), newcombe(1, 1, 0, 0)), (None, None, None));
    assert_eq!((newcombe_paired(0, 0, 0, 0), newcombe_paired(u64::MAX, 1, 0, 0)), (None, None));
    assert_eq!((mcnemar(0, 0), mcnemar(u64::MAX, 1), mcnemar(MOST_TRIALS, 1)), (Some(1.0), None, None));
    assert_eq!(
        (fisher(0, 0, 0, 0), fisher(3, 4, 0, 0), fisher(u64::MAX, 1, 1, 1)),
        (Some(1.0), Some(1.0), None)
    );
    assert_eq!((binomial_at_least(1, 2, f64::NAN), binomial_at_least(1, 2, 1.5)), (None, None));
    assert_eq!((student_quantile(1.0, 2.0), student_quantile(0.2, 0.0)), (None, None));
}

#[test]
fn the_largest_counts_end_soon() {
    let half = MOST_TRIALS / 2;
    near(mcnemar(half + 1000, half - 1000), 0.045_608_299_9, 1e-9);
    near(fisher(half / 2, half / 2, half / 2, half / 2), 1.0, 0.0);
    assert!(fisher(half, 0, 0, half) < Some(1e-300));
}

/// Table of Student's t in Abramowitz and Stegun 1964, 26.10, and of R's `qt`.
#[test]
fn quantiles_of_student() {
    for (degrees, t) in
        [(1.0, 12.706), (2.0, 4.303), (5.0, 2.571), (10.0, 2.228), (30.0, 2.042), (120.0, 1.980)]
    {
        near(student_quantile(0.975, degrees), t, 5e-4);
        near(student_two_sided(t, degrees), 0.05, 1e-4);
    }
    near(student_quantile(0.025, 10.0), -2.228_138_851_964_939, 1e-10);
    near(normal_two_sided(Z_95), 0.05, 1e-12);
}

// ---------------------------------------------------------------------------------------------
// What holds for all values

fn values(least: usize) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-1e3..1e3f64, least..40)
}

fn pairs(least: usize) -> impl Strategy<Value = (Vec<f64>, Vec<f64>)> {
    prop::collection::vec((-1e3..1e3f64, -1e3..1e3f64), least..40).prop_map(|pairs| pairs.into_iter().unzip())
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * (1.0 + a.abs().max(b.abs()))
}

/// All signs of the ranks, counted one by one.
fn wilcoxon_by_hand(a: &[f64], b: &[f64]) -> f64 {
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).filter(|it| *it != 0.0).collect();
    let rank = |it: f64| {
        let smaller = differences.iter().filter(|other| other.abs() < it.abs()).count();
        let equal = differences.iter().filter(|other| other.abs() == it.abs()).count();
        smaller as f64 + (equal as f64 + 1.0) / 2.0
    };
    let ranks: Vec<f64> = differences.iter().map(|it| rank(*it)).collect();
    let middle = ranks.iter().sum::<f64>() / 2.0;
    let v: f64 = ranks.iter().zip(&differences).filter(|(_, it)| **it > 0.0).map(|(rank, _)| rank).sum();
    let far = (0..1u32 << ranks.len()).filter(|signs| {
        let sum: f64 =
            (ranks.iter().enumerate()).filter(|(i, _)| signs >> i & 1 == 1).map(|(_, rank)| rank).sum();
        (sum - middle).abs() >= (v - middle).abs()
    });
    far.count() as f64 / f64::from(1u32 << ranks.len())
}

proptest! {
    #[test]
    fn summaries_are_in_order(values in values(2)) {
        let it = Summary::of(&values).expect("there are values");
        prop_assert!(it.min <= it.q1 && it.q1 <= it.median && it.median <= it.q3 && it.q3 <= it.max);
        prop_assert!(it.min <= it.mean + 1e-9 && it.mean <= it.max + 1e-9);
        prop_assert!(it.low <= Some(it.mean) && Some(it.mean) <= it.high);
        if let Some(interval) = median_interval(&values) {
            prop_assert!(interval.low <= it.median && it.median <= interval.high);
        }
    }

    #[test]
    fn shifts_and_scales((a, b) in pairs(3), shift in -100.0..100.0f64, scale in 0.01..100.0f64) {
        let moved = |values: &[f64]| values.iter().map(|it| it * scale + shift).collect::<Vec<_>>();
        for test in [paired_t, welch_t] {
            let (before, after) = (test(&a, &b).expect("it can be tested"), test(&moved(&a), &moved(&b)).expect("it can be tested"));
            prop_assert!(close(before.t, after.t) && close(before.p, after.p));
            prop_assert!(close(before.low * scale, after.low) && close(before.high * scale, after.high));
        }
        for size in [cohens_d, hedges_g, d_z] {
            prop_assert!(close(size(&a, &b).expect("it scatters"), size(&moved(&a), &moved(&b)).expect("it scatters")));
        }
        prop_assert!(close(mean(&a).expect("there are some") * scale + shift, mean(&moved(&a)).expect("there are some")));
    }

    #[test]
    fn the_other_way_round((a, b) in pairs(2)) {
        for test in [paired_t, welch_t] {
            let (one, other) = (test(&a, &b).expect("it can be tested"), test(&b, &a).expect("it can be tested"));
            prop_assert!(close(one.t, -other.t) && one.p == other.p && close(one.low, -other.high));
            prop_assert!((0.0..=1.0).contains(&one.p) && (one.p < 0.05) == (one.low > 0.0 || one.high < 0.0));
        }
        let (one, other) = (wilcoxon(&a, &b).expect("it can be tested"), wilcoxon(&b, &a).expect("it can be tested"));
        prop_assert!(one.p == other.p && one.v + other.v == (one.n * (one.n + 1)) as f64 / 2.0);
        prop_assert_eq!(cliffs_delta(&a, &b), cliffs_delta(&b, &a).map(|it| -it));
    }

    #[test]
    fn signed_ranks_counted_one_by_one(a in prop::collection::vec(-5..5i32, 1..=10), b in prop::collection::vec(-5..5i32, 10)) {
        let [a, b]: [Vec<f64>; 2] = [a.clone(), b[..a.len()].to_vec()].map(|it| it.into_iter().map(f64::from).collect());
        prop_assert!(close(wilcoxon(&a, &b).expect("there are pairs").p, wilcoxon_by_hand(&a, &b).min(1.0)));
    }

    #[test]
    fn mcnemar_summed_one_by_one(b in 0..30u64, c in 0..30u64) {
        let n = b + c;
        let ways = |k: u64| (0..k).fold(1.0, |ways, i| ways * (n - i) as f64 / (i + 1) as f64);
        let sum: f64 = (b.max(c)..=n).map(ways).sum::<f64>() / 2f64.powi(i32::try_from(n).expect("it is small"));
        let p = mcnemar(b, c).expect("there are few");
        prop_assert!(close(p, (2.0 * sum).min(1.0)));
        prop_assert_eq!(mcnemar(c, b), Some(p));
    }

    #[test]
    fn tables_turned_around(a in 0..60u64, b in 0..60u64, c in 0..60u64, d in 0..60u64) {
        let p = fisher(a, b, c, d).expect("there are few");
        prop_assert!((0.0..=1.0).contains(&p));
        for turned in [fisher(c, d, a, b), fisher(b, a, d, c), fisher(a, c, b, d)] {
            prop_assert!(close(turned.expect("there are few"), p));
        }
    }

    #[test]
    fn rates_are_in_their_intervals(k in 0..50u64, more in 0..50u64, l in 0..50u64, others in 0..50u64) {
        let (m, n) = (k + more + 1, l + others + 1);
        let interval = wilson(k, m).expect("there are trials");
        let rate = k as f64 / m as f64;
        prop_assert!(0.0 <= interval.low && interval.low <= rate && rate <= interval.high && interval.high <= 1.0);
        for found in [newcombe(k, m, l, n), newcombe_paired(k, more, l, others + 1)] {
            let it = found.expect("there are trials");
            prop_assert!(-1.0 - 1e-12 <= it.low && it.low <= it.difference && it.difference <= it.high && it.high <= 1.0 + 1e-12);
        }
    }

    #[test]
    fn holm_keeps_the_order(ps in prop::collection::vec(0.0..=1.0f64, 0..12)) {
        let corrected = holm(&ps).expect("they are probabilities");
        for (i, p) in ps.iter().enumerate() {
            prop_assert!(*p <= corrected[i] && corrected[i] <= 1.0);
            for (j, other) in ps.iter().enumerate() {
                prop_assert!(p > other || corrected[i] <= corrected[j]);
            }
        }
    }

    #[test]
    fn quantiles_of_student_lead_back(p in 0.001..0.999f64, degrees in 0.5..500.0f64) {
        let t = student_quantile(p, degrees).expect("there is one");
        prop_assert!(close(student_two_sided(t, degrees).expect("there is one"), 2.0 * p.min(1.0 - p)));
    }
}
