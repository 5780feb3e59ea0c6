//! When versions of features begin and end, as CityGML, INSPIRE and national profiles write it, and which of them are converted.

use std::fmt;
use std::time::{SystemTime, UNIX_EPOCH};

use map3d_base::reason::{Message, Reason};

/// A day of the Gregorian calendar.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Day {
    year: i32,
    month: u8,
    day: u8,
}

impl Day {
    /// Parses `2026-11-27`, also with a time or a time zone behind it; `None` for anything else.
    pub fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        let date = text.get(..10).filter(|_| text.as_bytes().get(10).is_none_or(|next| b"TZ+- ".contains(next)))?;
        let mut parts = date.split('-');
        let mut number = |digits: usize| -> Option<i32> {
            parts.next().filter(|part| part.len() == digits && part.bytes().all(|b| b.is_ascii_digit()))?.parse().ok()
        };
        let (year, month, day) = (number(4)?, number(2)?, number(2)?);
        ((1..=12).contains(&month) && (1..=31).contains(&day)).then_some(Self { year, month: month as u8, day: day as u8 })
    }

    /// Returns the present day, UTC.
    fn today() -> Self {
        let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs());
        Self::of_unix_day((seconds / 86_400) as i64)
    }

    /// Returns a day by its number of days after 1970-01-01 (Howard Hinnant, chrono-Compatible Low-Level Date Algorithms, `civil_from_days`).
    fn of_unix_day(days: i64) -> Self {
        let shifted = days + 719_468;
        let (era, day_of_era) = (shifted.div_euclid(146_097), shifted.rem_euclid(146_097));
        let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
        let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
        let from_march = (5 * day_of_year + 2) / 153;
        let month = if from_march < 10 { from_march + 3 } else { from_march - 9 };
        let year = year_of_era + era * 400 + i64::from(month <= 2);
        Self { year: year as i32, month: month as u8, day: (day_of_year - (153 * from_march + 2) / 5 + 1) as u8 }
    }
}

/// The date whose versions are converted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VersionDate {
    /// What has not ended before this day, which is that of the import; whatever has not begun yet is planned and drawn.
    Current(Day),
    /// What exists on the day.
    Requested(Day),
}

impl VersionDate {
    pub fn today() -> Self {
        Self::Current(Day::today())
    }

    /// Returns why a version is not converted.
    pub fn reason(self) -> Message {
        match self {
            Self::Current(_) => Reason::VersionEnded.into(),
            Self::Requested(day) => Reason::VersionOfOtherDate.with("date", day.to_string()),
        }
    }
}

impl fmt::Display for Day {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{:04}-{:02}-{:02}", self.year, self.month, self.day)
    }
}

/// When the version of a feature begins and ends, as far as it is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lifespan {
    /// In the world.
    valid_from: Option<Day>,
    /// In the data set.
    created: Option<Day>,
    /// The earlier of the ends in the world and in the data set: the version does not exist on that day any more.
    end: Option<Day>,
}

impl Lifespan {
    /// Notes a property of the feature if it is a date of its lifespan.
    pub fn add_property(&mut self, local_name: &str, text: &str) {
        match local_name {
            "validFrom" => self.valid_from = Day::parse(text),
            "creationDate" | "beginLifespanVersion" => self.created = Day::parse(text),
            "validTo" | "terminationDate" | "endLifespanVersion" => {
                let earlier = |day: Day| self.end.map_or(day, |end| end.min(day));
                self.end = Day::parse(text).map(earlier).or(self.end);
            }
            _ => {}
        }
    }

    pub fn has_end(&self) -> bool {
        self.end.is_some()
    }

    pub fn exists(&self, date: VersionDate) -> bool {
        let has_ended = |day: Day| self.end.is_some_and(|end| end <= day);
        match date {
            VersionDate::Current(day) => !has_ended(day),
            VersionDate::Requested(day) => !has_ended(day) && self.valid_from.or(self.created).is_none_or(|begin| begin <= day),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn day(text: &str) -> Day {
        Day::parse(text).expect("a day")
    }

    #[test]
    fn days_are_read_from_dates_and_times() {
        for text in ["2026-11-27", " 2026-11-27T10:00:00Z ", "2026-11-27+01:00", "2026-11-27 10:00"] {
            assert_eq!(Day::parse(text), Some(Day { year: 2026, month: 11, day: 27 }), "{text}");
        }
        for text in ["", "2026", "27.11.2026", "2026-13-01", "2026-11-32", "2026-11-27x", "20261-1-27", "２０26-11-27"] {
            assert_eq!(Day::parse(text), None, "{text}");
        }
        assert_eq!(
            (Day::of_unix_day(0), Day::of_unix_day(19_782), Day::of_unix_day(20_784)),
            (day("1970-01-01"), day("2024-02-29"), day("2026-11-27"))
        );
        assert!(Day::today() > day("2026-01-01"));
    }

    #[test]
    fn versions_exist_from_their_begin_to_the_day_before_their_end() {
        let lifespan = |properties: &[(&str, &str)]| {
            let mut lifespan = Lifespan::default();
            properties.iter().for_each(|(name, text)| lifespan.add_property(name, text));
            lifespan
        };
        for (properties, current, requested) in [
            (&[][..], true, true),
            (&[("creationDate", "2015-01-01")], true, false),
            (&[("creationDate", "2015-01-01"), ("validFrom", "1990-01-01T00:00:00")], true, true),
            (&[("terminationDate", "2015-01-01")], false, true),
            (&[("terminationDate", "2012-06-01")], false, false),
            (&[("terminationDate", "9999-12-31")], true, true),
            (&[("validTo", "2030-01-01"), ("terminationDate", "2016-01-01")], false, true),
            (&[("validTo", "2011-01-01T12:00:00Z")], false, false),
            (&[("validTo", "2030-01-01")], true, true),
            (&[("endLifespanVersion", "unknown")], true, true),
        ] {
            let lifespan = lifespan(properties);
            let found = [VersionDate::Current(day("2026-11-27")), VersionDate::Requested(day("2012-06-01"))].map(|date| lifespan.exists(date));
            assert_eq!(found, [current, requested], "{properties:?}");
        }
    }
}
