//! What a server logs is changed while it runs.

use serde_json::json;

use crate::harness::{Process, accepted, run, soon};

#[tokio::test]
async fn the_level_is_shown_changed_and_goes_back_by_itself() {
    let folder = tempfile::tempdir().unwrap();
    let server = Process::serve(&folder.path().join("palpate.db")).await;
    let url = server.url();
    let level =
        async |more: &[&str]| run(folder.path(), &[&["log-level", "--server", &url], more].concat()).await;
    assert_eq!(level(&[]).await.out, "info\n");
    assert_eq!(level(&["palpate_server=debug,info"]).await.out, "palpate_server=debug,info\n");
    let for_a_while = level(&["trace", "--for", "10m"]).await.out;
    assert!(for_a_while.starts_with("trace, until 2"), "{for_a_while}");
    assert!(for_a_while.ends_with("Z, then palpate_server=debug,info\n"), "{for_a_while}");
    // A shorter while in its place, after which the usual level holds and not the one in between.
    level(&["warn", "--for", "200ms"]).await;
    let usual = async {
        while level(&[]).await.out != "palpate_server=debug,info\n" {
            tokio::time::sleep(std::time::Duration::from_millis(50)).await;
        }
    };
    soon("the usual level", usual).await;

    let refused = level(&["banana"]).await;
    assert!(refused.code == Some(2) && refused.err.contains("`banana` is no level"), "{refused:?}");
    for (body, field) in
        [(json!({ "filter": "banana" }), "filter"), (json!({ "filter": "info", "for_s": -1 }), "for_s")]
    {
        let put = server.http().request(reqwest::Method::PUT, "/v1/log-level").json(&body);
        let refused = accepted(put).await.unwrap_err();
        assert_eq!((refused.reason.as_str(), refused.fields), ("FIELD_INVALID", vec![field.to_owned()]));
    }
    server.terminate().await;
    let nobody = level(&[]).await;
    assert!(nobody.code == Some(1) && nobody.err.contains(&url), "{nobody:?}");
}
