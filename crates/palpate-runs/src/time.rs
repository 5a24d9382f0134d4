//! Dates without a calendar library.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Time since 1970-01-01T00:00:00Z; 0 where the clock is set before it.
pub(crate) fn since_epoch() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

/// A moment in UTC, Gregorian calendar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Utc {
    year: u64,
    month: u64,
    day: u64,
    second_of_day: u64,
}

impl Utc {
    pub(crate) fn new(since_epoch: Duration) -> Self {
        const DAY: u64 = 86_400;
        let mut days = since_epoch.as_secs() / DAY;
        let leap =
            |y: u64| y.is_multiple_of(4) && (!y.is_multiple_of(100) || y.is_multiple_of(400));
        let mut year = 1970;
        while days >= 365 + u64::from(leap(year)) {
            days -= 365 + u64::from(leap(year));
            year += 1;
        }
        let mut month = 1;
        for length in [31, 28 + u64::from(leap(year)), 31, 30, 31, 30, 31, 31, 30, 31, 30] {
            if days < length {
                break;
            }
            days -= length;
            month += 1;
        }
        Self { year, month, day: days + 1, second_of_day: since_epoch.as_secs() % DAY }
    }

    fn clock(self) -> (u64, u64, u64) {
        let s = self.second_of_day;
        (s / 3600, s / 60 % 60, s % 60)
    }

    /// `2026-11-22_154500`, for folder names.
    pub(crate) fn stamp(self) -> String {
        let (h, m, s) = self.clock();
        format!("{:04}-{:02}-{:02}_{h:02}{m:02}{s:02}", self.year, self.month, self.day)
    }

    /// `2026-11-22T15:45:00Z`, RFC 3339.
    pub(crate) fn rfc3339(self) -> String {
        let (h, m, s) = self.clock();
        format!("{:04}-{:02}-{:02}T{h:02}:{m:02}:{s:02}Z", self.year, self.month, self.day)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expected: `date -u -d @SECONDS +%FT%TZ`.
    #[test]
    fn dates_agree_with_the_system_calendar() {
        for (seconds, date) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_399, "2000-02-28T23:59:59Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (1_709_251_199, "2024-02-29T23:59:59Z"),
            (1_767_225_599, "2025-12-31T23:59:59Z"),
            (1_795_362_300, "2026-11-22T15:45:00Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(Utc::new(Duration::from_secs(seconds)).rfc3339(), date);
        }
        assert_eq!(Utc::new(Duration::from_secs(1_795_362_301)).stamp(), "2026-11-22_154501");
    }
}
