//! Tables for spreadsheets and data frames, as RFC 4180 has them.

use axum::response::{IntoResponse, Response};
use http::HeaderMap;
use http::header::{CONTENT_DISPOSITION, CONTENT_TYPE, VARY};

use super::negotiation;
use crate::error::Error;
use crate::text::quoted;

/// Whether a table is wanted, by the query's `format` or the `Accept` header; JSON is what is sent otherwise.
///
/// # Errors
/// `format` is neither csv nor json.
pub(super) fn is_wanted(format: Option<&str>, headers: &HeaderMap) -> Result<bool, Error> {
    match format {
        Some("csv") => Ok(true),
        Some("json") => Ok(false),
        Some(other) => Err(Error::field("format", format!("{} is neither csv nor json", quoted(other)))),
        None => Ok(negotiation::names(headers, "text/csv")),
    }
}

/// Rows as a file called `name`, the first one being the names of the columns.
pub(super) fn table(rows: &[Vec<String>], name: &str) -> Result<Response, Error> {
    let mut writer = csv::WriterBuilder::new().terminator(csv::Terminator::CRLF).from_writer(Vec::new());
    let broken = |error: &dyn std::fmt::Display| Error::internal(format!("a table was not written: {error}"));
    for row in rows {
        writer.write_record(row).map_err(|error| broken(&error))?;
    }
    let bytes = writer.into_inner().map_err(|error| broken(&error))?;
    let headers = [
        (CONTENT_TYPE, "text/csv; charset=utf-8; header=present".to_owned()),
        (CONTENT_DISPOSITION, format!("inline; filename=\"{name}.csv\"")),
        (VARY, "accept".to_owned()),
    ];
    Ok((headers, bytes).into_response())
}

/// A cell that is empty where there is nothing.
pub(super) fn cell<T: ToString>(value: Option<T>) -> String {
    value.map(|value| value.to_string()).unwrap_or_default()
}

/// The name of a value of an enum without the enum's own name in front, in lower case.
pub(super) fn short(name: &str, prefix: &str) -> String {
    name.strip_prefix(prefix).unwrap_or(name).to_ascii_lowercase()
}

#[cfg(test)]
mod tests {
    use http::HeaderValue;
    use http::header::ACCEPT;

    use super::*;

    #[tokio::test]
    async fn cells_are_quoted_where_they_have_to_be() {
        let rows =
            [vec!["robot".to_owned(), "x".into()], vec!["the \"left\", arm\n".into(), cell(Some(0.25))]];
        let response = table(&rows, "mug-series").unwrap();
        assert_eq!(response.headers()[CONTENT_DISPOSITION], "inline; filename=\"mug-series.csv\"");
        let body = axum::body::to_bytes(response.into_body(), 1000).await.unwrap();
        assert_eq!(&body[..], b"robot,x\r\n\"the \"\"left\"\", arm\n\",0.25\r\n");
    }

    #[test]
    fn a_table_is_sent_to_who_asks_for_one() {
        let mut headers = HeaderMap::new();
        assert!(!is_wanted(None, &headers).unwrap());
        assert!(is_wanted(Some("csv"), &headers).unwrap());
        headers.insert(ACCEPT, HeaderValue::from_static("text/csv"));
        assert!(is_wanted(None, &headers).unwrap());
        assert!(!is_wanted(Some("json"), &headers).unwrap());
        assert_eq!(is_wanted(Some("xls"), &headers).unwrap_err().fields()[0].field, "format");
    }
}
